"""Start and stop of SYNC signals, ETG.1000.4 §6.8.5 and ETG.1020 §"Distributed clocks".

SYNC signals are started in PRE-OP, because devices check them on the way to SAFE-OP. All devices
receive the same start time plus their shift. It must be in the future when the last device receives
it. This is verified, because a 32-bit clock reaches a past start time again only after 4 s, and a
64-bit clock never does.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from contextlib import suppress

from catenary.errors import ClockError, SdoAbort
from catenary.model.device import DeviceDescription
from catenary.plan.clocks import BURST, SYNC_OBJECTS, SyncPlan, start_time_ns
from catenary.plan.cycle import FollowedClock
from catenary.procedure.clocks import (
    SPAN_32,
    SPAN_64,
    ClockMeasurement,
    RingEnd,
    align,
    alignment,
    compensate,
    filters,
    lead,
    measure,
)
from catenary.procedure.exchange import Procedure, Reply, Request, read, write
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import OPTIONAL_ABORTS
from catenary.procedure.sdo import download, upload
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import (
    ACTIVATION,
    ASSIGN_ACTIVATE,
    SYNC0_START_TIME,
    SYNC0_START_TIME_LOW,
    SYNC_CYCLE_TIMES,
    SYSTEM_TIME,
    SYSTEM_TIME_LOW,
)

ATTEMPTS = 3
PEERS_MAX = 4  # number of devices whose system time is read
AHEAD_NS = 1_000_000  # minimum time between the last write and the start time


def bring_together(
    devices: Sequence[DeviceDescription],
    syncs: Mapping[int, SyncPlan],
    reference: int,
    epoch_ns: int,
    burst: int = BURST,
    follow: FollowedClock = "reference",
    second_end: RingEnd | None = None,
) -> Procedure[ClockMeasurement]:
    """Set up distributed clocks before the cycle: measure, align, compensate, start SYNC signals.

    Args:
        devices: All devices, by position.
        syncs: The SYNC signals, by position.
        reference: Position of the reference clock.
        epoch_ns: System time minus the link's time [ns].
        burst: Number of frames of the drift compensation.
        follow: The clock that all others follow.
        second_end: In a ring, the port that is wired to the second interface; None for a line.

    Returns:
        The measurement of the clocks.

    Raises:
        ClockError: The clocks cannot be set up.
    """
    measured = yield from measure(devices, second_end=second_end)
    yield from align(devices, measured, reference, epoch_ns)
    if follow == "main":
        yield from lead(devices[reference], burst, epoch_ns)
    else:
        yield from compensate(devices[reference], burst)
    yield from start(devices, syncs, devices[reference], epoch_ns)
    return measured


def rejoin(
    devices: Sequence[DeviceDescription],
    position: int,
    sync: SyncPlan | None,
    peers: Sequence[int],
    delay_ns: int,
    epoch_ns: int,
) -> Procedure[None]:
    """Set the clock of a device that was switched off, and start its SYNC signals.

    All other clocks keep running.
    The system times of the device and of its peers are read in the same frame. Their difference is
    the offset.

    Args:
        devices: All devices, by position.
        position: Position of the device.
        sync: Its SYNC signals; None if it has none.
        peers: Positions of devices with running clocks, the reference first.
        delay_ns: Its delay from the reference, as measured earlier [ns].
        epoch_ns: Present system time minus the link's time [ns].

    Raises:
        ClockError: None of the peers answers, or the SYNC signals do not start in time.
    """
    device = devices[position]
    resets = filters(device.station_address)
    for each in (*alignment(device, 0, delay_ns), *resets):
        yield from _write_all([device], [each])
    chosen = [devices[peer] for peer in peers if peer != position][:PEERS_MAX]
    replies = yield [_system_time(each) for each in (*chosen, device)]
    own = _read_time(replies[-1], device, epoch_ns)
    for peer, reply in zip(chosen, replies, strict=False):
        if reply.lost or reply.working_counter != 1:
            continue
        offset = _read_time(reply, peer, epoch_ns) - own
        yield from _write_all([device] * 2, list(alignment(device, offset, delay_ns)))
        yield from _write_all([device], list(resets[-1:]))
        if sync is not None:
            yield from start(devices, {position: sync}, peer, epoch_ns)
        return
    raise ClockError(
        f"{device}: its clock cannot be set, because no other clock answers",
        hint="the loop tries again when the reference clock or another clock returns",
    )


def start(
    devices: Sequence[DeviceDescription],
    syncs: Mapping[int, SyncPlan],
    reference: DeviceDescription,
    epoch_ns: int,
) -> Procedure[int]:
    """Start the SYNC signals of all devices at one common time.

    Args:
        devices: All devices, by position.
        syncs: The SYNC signals, by position.
        reference: The reference clock.
        epoch_ns: System time minus the link's time [ns].

    Returns:
        The common SYNC0 time, without the shifts of the devices [ns, system time].

    Raises:
        ClockError: The start time passed before all devices had received it.
    """
    chosen = [devices[position] for position in sorted(syncs)]
    for _ in range(ATTEMPTS):
        yield from stop(chosen)
        yield from _write_all(chosen, [_cycle_times(d, syncs[d.position]) for d in chosen])
        now_ns = yield from _now(reference, epoch_ns)
        sync0_time_ns = start_time_ns(now_ns, list(syncs.values()))
        yield from _write_all(
            chosen, [_start_time(d, syncs[d.position], sync0_time_ns) for d in chosen]
        )
        yield from _write_all(chosen, [_activation(d, syncs[d.position]) for d in chosen])
        written_ns = yield from _now(reference, epoch_ns)
        first_ns = sync0_time_ns + min(sync.shift_ns for sync in syncs.values())
        if written_ns + AHEAD_NS < first_ns:
            return sync0_time_ns
    raise ClockError(
        f"SYNC signals: the start time passed before all {len(chosen)} devices received it: in "
        f"{ATTEMPTS} attempts, writing took longer than {(sync0_time_ns - now_ns) * 1e-6:.0f} ms",
        hint="the machine is too busy: reserve a processor core for the program",
    )


def read_types(channel: MailboxChannel) -> Procedure[dict[int, bytes]]:
    """Read the synchronisation types of a device (0x1C32:01, 0x1C33:01), if they are readable."""
    found = {}
    for index in SYNC_OBJECTS:
        with suppress(SdoAbort):
            found[index] = yield from upload(channel, index, 1)
    return found


def write_types(channel: MailboxChannel, types: Mapping[int, bytes]) -> Procedure[None]:
    """Restore the earlier synchronisation types of a device, if they are writable.

    Args:
        channel: The mailbox of the device.
        types: The values of 0x1C32:01 and 0x1C33:01, by index.

    Raises:
        SdoAbort: The device refuses for a reason other than a missing or read-only object.
    """
    for index, kind in types.items():
        try:
            yield from download(channel, index, 1, kind)
        except SdoAbort as abort:
            if abort.code not in OPTIONAL_ABORTS:
                raise


def stop(devices: Sequence[DeviceDescription]) -> Procedure[None]:
    """Stop the SYNC signals of the devices."""
    yield from _write_all(
        devices, [write(EcatCommand.FPWR, d.station_address, ACTIVATION, 0) for d in devices]
    )


def _now(reference: DeviceDescription, epoch_ns: int) -> Procedure[int]:
    """Return the full system time: the reference's low half, extended with the link's time."""
    [reply] = yield [read(EcatCommand.FPRD, reference.station_address, SYSTEM_TIME_LOW)]
    low = SYSTEM_TIME_LOW.unpack(answered(reply, _station(reference), "its system time"))
    return _near(low, reply.time_ns + epoch_ns)


def _system_time(device: DeviceDescription) -> Request:
    register = SYSTEM_TIME if device.clock_bits == 64 else SYSTEM_TIME_LOW
    return read(EcatCommand.FPRD, device.station_address, register)


def _read_time(reply: Reply, device: DeviceDescription, epoch_ns: int) -> int:
    """Return the full system time of a reply. A 32-bit time is extended with the link's time."""
    value = int.from_bytes(answered(reply, _station(device), "its system time"), "little")
    return value if device.clock_bits == 64 else _near(value, reply.time_ns + epoch_ns)


def _near(low: int, near: int) -> int:
    return near + (low - near + SPAN_32 // 2) % SPAN_32 - SPAN_32 // 2


def _cycle_times(device: DeviceDescription, sync: SyncPlan) -> Request:
    times = struct.pack("<II", sync.cycle_ns, sync.sync1_ns)
    return write(EcatCommand.FPWR, device.station_address, SYNC_CYCLE_TIMES, times)


def _start_time(device: DeviceDescription, sync: SyncPlan, sync0_time_ns: int) -> Request:
    start_ns = sync0_time_ns + sync.shift_ns
    if device.clock_bits == 64:
        return write(EcatCommand.FPWR, device.station_address, SYNC0_START_TIME, start_ns % SPAN_64)
    return write(EcatCommand.FPWR, device.station_address, SYNC0_START_TIME_LOW, start_ns % SPAN_32)


def _activation(device: DeviceDescription, sync: SyncPlan) -> Request:
    assign = struct.pack("<H", sync.assign_activate)
    return write(EcatCommand.FPWR, device.station_address, ASSIGN_ACTIVATE, assign)


def _write_all(devices: Sequence[DeviceDescription], requests: list[Request]) -> Procedure[None]:
    if not requests:
        return
    for device, reply in zip(devices, (yield requests), strict=True):
        answered(reply, _station(device), "its SYNC unit")


def _station(device: DeviceDescription) -> Station:
    return Station(device.position, device.station_address, device.name)
