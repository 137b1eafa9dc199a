"""Set-up of distributed clocks in PRE-OP: delay measurement, offsets, filters, drift compensation.

Sources: ETG.1000.4 §6.8; ETG.1020 §"Distributed clocks"; Beckhoff, ESC data sheet I, §9.1.2 to
§9.1.5.

The system time of a device is its local time plus its offset. Its time loop follows the time of the
reference clock, which a frame carries, plus the propagation delay. A device may stamp receive times
without having a system time (an EL2828, for example: ethercrab's capture replay-dc.pcapng). Its
times are used to measure delays, but its clock is not configured, as in IgH (`has_dc_system_time`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from catenary.errors import ClockError
from catenary.model.delays import ClockPlace, PortTimes, delays_ns
from catenary.model.device import DeviceDescription
from catenary.plan.clocks import BURST
from catenary.procedure.exchange import Procedure, Reply, Request, read, write
from catenary.procedure.open_ring import as_line
from catenary.procedure.station import Station, answered
from catenary.wire.clock import decode_receive_times
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import (
    RECEIVE_TIME_LATCH,
    RECEIVE_TIME_PROCESSING_UNIT,
    RECEIVE_TIMES,
    SPEED_COUNTER_FILTER,
    SPEED_COUNTER_START,
    SYSTEM_TIME,
    SYSTEM_TIME_DELAY,
    SYSTEM_TIME_DIFFERENCE_FILTER,
    SYSTEM_TIME_LOW,
    SYSTEM_TIME_OFFSET,
    SYSTEM_TIME_OFFSET_LOW,
)

LATCHES = 16  # number of latches to average: time stamps jitter by 10 ns or more
LOST_MAX = 16  # lost frames in a row after which the reference is assumed lost
BURST_STEP = 512  # frames per step of the procedure
# Values that SOEM (`ecx_set_slaves_to_default`), KickCAT (`enableDC`) and ethercrab
# write: no filter on the difference, 2^12 on the speed, and the bandwidth of the loop.
DIFFERENCE_FILTER, SPEED_FILTER, SPEED_START = 0, 12, 0x1000
SPAN_64, SPAN_32 = 1 << 64, 1 << 32
RingEnd = tuple[int, int]  # position and port wired to the second interface


@dataclass(frozen=True, slots=True)
class ClockMeasurement:
    """Result of one measurement of the clocks of a segment. Tuples are indexed by position."""

    delays_ns: tuple[int | None, ...]  # delay from the first clock; None without a clock
    local_times_ns: tuple[int | None, ...]  # at the last latch; None without a system time
    latched_ns: int  # last latch on the link's clock; error: up to half a round trip

    @property
    def first(self) -> int | None:
        """Position of the default reference: the first device with a system time, or None."""
        for position, local in enumerate(self.local_times_ns):
            if local is not None:
                return position
        return None

    def runs(self, position: int) -> bool:
        """Return True if the device has a system time that can be synchronised."""
        return self.local_times_ns[position] is not None


def measure(
    devices: Sequence[DeviceDescription],
    *,
    second_end: RingEnd | None = None,
    latches: int = LATCHES,
) -> Procedure[ClockMeasurement]:
    """Latch all receive times several times, and compute the delays.

    Args:
        devices: All devices, by position.
        second_end: In a ring, the port to close during the measurement. In an intact ring, frames
            do not return through the ports. None for a line.
        latches: The number of latches.

    Raises:
        ClockError: Not all clocks received the broadcast that latches the times, or the port of the
            ring did not stay closed.
    """
    if second_end is None:
        return (yield from _measure(devices, latches))
    position, port = second_end
    end = devices[position]
    port_0, port_1, port_2, port_3 = (p != port and end.open_ports[p] for p in range(4))
    last = replace(end, open_ports=(port_0, port_1, port_2, port_3))
    line = [last if device is end else device for device in devices]
    return (yield from as_line(_station(end), port, _measure(line, latches)))


def _measure(devices: Sequence[DeviceDescription], latches: int) -> Procedure[ClockMeasurement]:
    clocks = [device for device in devices if device.controller.supports_clocks]
    if not clocks:
        return ClockMeasurement((None,) * len(devices), (None,) * len(devices), 0)
    measured: list[list[ClockPlace]] = []
    for _ in range(latches):
        latched_ns = yield from _latch(clocks)
        replies = yield [request for device in clocks for request in _time_reads(device)]
        answers = dict(zip((d.position for d in clocks), _pairs(replies), strict=True))
        times = {d.position: _port_times(d, answers[d.position][0]) for d in clocks}
        measured.append([_place(device, times.get(device.position)) for device in devices])
    local = {d.position: _local_time(d, answers[d.position]) for d in clocks}
    return ClockMeasurement(
        delays_ns(measured),
        tuple(local[d.position] if d.clock_bits else None for d in devices),
        latched_ns,
    )


def align(
    devices: Sequence[DeviceDescription],
    measured: ClockMeasurement,
    reference: int,
    epoch_ns: int,
) -> Procedure[None]:
    """Write offset and delay of the reference and of all devices after it, and reset all filters.

    The system time of the reference is then the link's time + `epoch_ns`. The devices after it have
    the system time of the reference.

    Args:
        devices: All devices, by position.
        measured: The measurement of their clocks.
        reference: Position of the reference clock.
        epoch_ns: System time minus the link's time [ns].

    Raises:
        ClockError: The reference has no system time.
    """
    origin, nearest = measured.local_times_ns[reference], measured.delays_ns[reference]
    if origin is None or nearest is None:
        raise no_system_time(devices[reference])
    requests: list[Request] = []
    for device in devices[reference:]:
        local, delay = measured.local_times_ns[device.position], measured.delays_ns[device.position]
        if local is None or delay is None:
            continue
        behind = max(0, delay - nearest)
        offset = measured.latched_ns + epoch_ns + behind - local
        requests += alignment(device, offset, behind)
    requests += filters()
    for reply, request in zip((yield requests), requests, strict=True):
        if request.command is EcatCommand.FPWR:
            answered(reply, _station_at(devices, request), "offset and delay of its clock")


def compensate(device: DeviceDescription, count: int = BURST) -> Procedure[None]:
    """Run the static drift compensation: distribute the time of the reference in many frames.

    Each frame contains one datagram. A controller compares with the start time of the *frame*, so a
    second datagram has no effect (ESC data sheet I §9.1.5). KickCAT and ethercrab also send one per
    frame.

    Args:
        device: The reference clock.
        count: The number of frames.

    Raises:
        ClockError: The reference does not answer.
    """
    request = distribute(device)
    while count > 0:
        replies = yield [request] * min(count, BURST_STEP)
        count -= len(replies)
        if not any(map(_is_answer, replies)):
            raise _no_reference(device)


def lead(device: DeviceDescription, count: int, epoch_ns: int) -> Procedure[None]:
    """Run the static drift compensation for a reference that follows the MainDevice.

    Each frame writes a time to the reference: the MainDevice's time at the previous answer. With a
    real NIC, the reference then runs at the MainDevice's rate and lags by about 10 us. The cycle
    corrects the phase.

    Args:
        device: The reference clock.
        count: The number of frames.
        epoch_ns: System time minus the link's time [ns].

    Raises:
        ClockError: The reference does not answer.
    """
    register = SYSTEM_TIME_LOW
    [reply] = yield [read(EcatCommand.FPRD, device.station_address, register)]
    spread = distribute(device)._replace(alone=False)
    silent = 0
    for _ in range(count):
        now = (reply.time_ns + epoch_ns) % SPAN_32
        update = write(EcatCommand.FPWR, device.station_address, register, now, repeatable=False)
        answer, reply = yield [update, spread]
        silent = 0 if _is_answer(answer) else silent + 1
        if silent > LOST_MAX:
            raise _no_reference(device)


def _is_answer(reply: Reply) -> bool:
    return not reply.lost and reply.working_counter > 0


def _no_reference(device: DeviceDescription) -> ClockError:
    return ClockError(
        f"{_station(device)}: the reference clock does not answer",
        hint="it was switched off, reset or unplugged: scan again",
    )


def distribute(device: DeviceDescription) -> Request:
    """Return the FRMW request that distributes the low half of the system time.

    The time loop of each clock compares it with its own system time.
    """
    request = read(EcatCommand.FRMW, device.station_address, SYSTEM_TIME_LOW)
    return request._replace(repeatable=False, alone=True)


def alignment(device: DeviceDescription, offset: int, delay: int) -> tuple[Request, Request]:
    """Return the requests that write the offset and the delay of a clock.

    Args:
        device: The device.
        offset: System time minus local time [ns].
        delay: Delay from the reference clock [ns].
    """
    station = device.station_address
    if device.clock_bits == 64:
        written = write(EcatCommand.FPWR, station, SYSTEM_TIME_OFFSET, offset % SPAN_64)
    else:  # ethercrab #322: a 32-bit clock rejects eight bytes
        written = write(EcatCommand.FPWR, station, SYSTEM_TIME_OFFSET_LOW, offset % SPAN_32)
    return written, write(EcatCommand.FPWR, station, SYSTEM_TIME_DELAY, delay)


def filters(station: int | None = None) -> tuple[Request, ...]:
    """Return the requests that reset the time loop of `station`, or of all devices if it is None.

    Filter depths are written first, because some controllers apply them when the loop is reset.
    """
    command = EcatCommand.BWR if station is None else EcatCommand.FPWR
    return (
        write(command, station or 0, SYSTEM_TIME_DIFFERENCE_FILTER, DIFFERENCE_FILTER),
        write(command, station or 0, SPEED_COUNTER_FILTER, SPEED_FILTER),
        write(command, station or 0, SPEED_COUNTER_START, SPEED_START),
    )


def read_system_time(device: DeviceDescription) -> Procedure[int]:
    """Read the system time of a device [ns]; for a 32-bit clock, the low half."""
    register = SYSTEM_TIME if device.clock_bits == 64 else SYSTEM_TIME_LOW
    [reply] = yield [read(EcatCommand.FPRD, device.station_address, register)]
    return register.unpack(answered(reply, _station(device), "its system time"))


def no_system_time(device: DeviceDescription) -> ClockError:
    """Return the error for a device without the requested clock."""
    what = "only stamps receive times" if device.controller.supports_clocks else "has none"
    return ClockError(
        f"{device}: distributed clocks were requested, but the device {what}",
        hint="remove it from dc=, or choose another reference clock",
    )


def _latch(clocks: Sequence[DeviceDescription]) -> Procedure[int]:
    """Latch the receive times of all ports by broadcast, and return the time [ns, link's clock].

    Raises ClockError if fewer devices than `clocks` received the broadcast.
    """
    [before] = yield [read(EcatCommand.FPRD, clocks[0].station_address, RECEIVE_TIME_LATCH)]
    [reply] = yield [write(EcatCommand.BWR, 0, RECEIVE_TIME_LATCH, 0)]
    if reply.lost or reply.working_counter < len(clocks):
        raise ClockError(
            f"{reply.working_counter} of {len(clocks)} devices with clocks received the broadcast "
            "that measures delays",
            hint="the number of devices is not stable: check for a loose contact, then scan again",
        )
    return (before.time_ns + reply.time_ns) // 2


def _time_reads(device: DeviceDescription) -> tuple[Request, Request]:
    """Return the requests for port times and local time. A 32-bit clock uses the time of port 0."""
    station = device.station_address
    if device.clock_bits == 64:
        unit = read(EcatCommand.FPRD, station, RECEIVE_TIME_PROCESSING_UNIT)
    else:
        unit = read(EcatCommand.FPRD, station, RECEIVE_TIME_LATCH)
    return read(EcatCommand.FPRD, station, RECEIVE_TIMES), unit


def _pairs(replies: Sequence[Reply]) -> Iterator[tuple[Reply, Reply]]:
    return zip(replies[::2], replies[1::2], strict=True)


def _port_times(device: DeviceDescription, reply: Reply) -> PortTimes:
    return decode_receive_times(answered(reply, _station(device), "receive times"))


def _local_time(device: DeviceDescription, answers: tuple[Reply, Reply]) -> int:
    ports, unit = answers
    if unit.working_counter != 1:  # no such register: use port 0, without the upper half
        return _port_times(device, ports)[0]
    return int.from_bytes(unit.data, "little")


def _place(device: DeviceDescription, times: PortTimes | None) -> ClockPlace:
    return ClockPlace(device.parent, device.parent_port, device.open_ports, times)


def _station(device: DeviceDescription) -> Station:
    return Station(device.position, device.station_address, device.full_name)


def _station_at(devices: Sequence[DeviceDescription], request: Request) -> Station:
    address = request.address & 0xFFFF
    return _station(next(d for d in devices if d.station_address == address))
