"""SYNC signals started and stopped, ETG.1000.4 §6.8.5 and ETG.1020 §"Distributed clocks". In
PRE-OP, before SAFE-OP is asked for: devices check then that what they need is running.

All are told one start time, far enough ahead, and it is verified that all were told in time: a
start time that has passed comes again after 4 s in a 32-bit clock, and never in one of 64 bits.
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
from catenary.procedure.pdo import LEFT_ALONE
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
PEERS_MAX = 4  # asked what time it is
AHEAD_NS = 1_000_000  # what must be left of the time ahead when all have been told


def bring_together(
    devices: Sequence[DeviceDescription],
    syncs: Mapping[int, SyncPlan],
    reference: int,
    epoch_ns: int,
    burst: int = BURST,
    follow: FollowedClock = "reference",
    second_end: RingEnd | None = None,
) -> Procedure[ClockMeasurement]:
    """All there is to do before the cycle: clocks measured, aligned, brought together by a burst of
    `burst` frames, SYNC signals started. `syncs`: by position. `second_end`: of a ring."""
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
    """The clock of a device that was switched off, set while all others run: by what one of its
    `peers` (positions, the reference first) says to the same frame. ClockError if none answers.
    `delay_ns`: as it was measured before; `epoch_ns`: system time less the link's, now."""
    device = devices[position]
    told = filters(device.station_address)
    for each in (*alignment(device, 0, delay_ns), *told):
        yield from _write_all([device], [each])
    asked = [devices[peer] for peer in peers if peer != position][:PEERS_MAX]
    replies = yield [_system_time(each) for each in (*asked, device)]
    own = _read_time(replies[-1], device, epoch_ns)
    for peer, reply in zip(asked, replies, strict=False):
        if reply.lost or reply.working_counter != 1:
            continue
        offset = _read_time(reply, peer, epoch_ns) - own
        yield from _write_all([device] * 2, list(alignment(device, offset, delay_ns)))
        yield from _write_all([device], list(told[-1:]))
        if sync is not None:
            yield from start(devices, {position: sync}, peer, epoch_ns)
        return
    raise ClockError(
        f"{device}: no clock answers that its own could be set by",
        hint="it is tried again when the reference clock or another one is back",
    )


def start(
    devices: Sequence[DeviceDescription],
    syncs: Mapping[int, SyncPlan],
    reference: DeviceDescription,
    epoch_ns: int,
) -> Procedure[int]:
    """Lets the SYNC signals begin, at one beat for all. Returns that time [ns, system time]."""
    chosen = [devices[position] for position in sorted(syncs)]
    for _ in range(ATTEMPTS):
        yield from stop(chosen)
        yield from _write_all(chosen, [_cycle_times(d, syncs[d.position]) for d in chosen])
        now_ns = yield from _now(reference, epoch_ns)
        beat_ns = start_time_ns(now_ns, list(syncs.values()))
        yield from _write_all(chosen, [_start_time(d, syncs[d.position], beat_ns) for d in chosen])
        yield from _write_all(chosen, [_activation(d, syncs[d.position]) for d in chosen])
        told_ns = yield from _now(reference, epoch_ns)
        first_ns = beat_ns + min(sync.shift_ns for sync in syncs.values())
        if told_ns + AHEAD_NS < first_ns:
            return beat_ns
    raise ClockError(
        f"SYNC signals: telling {len(chosen)} devices when to start took longer than the "
        f"{(beat_ns - now_ns) * 1e-6:.0f} ms ahead, {ATTEMPTS} times",
        hint="the machine is too busy: give the program a processor of its own",
    )


def read_types(channel: MailboxChannel) -> Procedure[dict[int, bytes]]:
    """Return how a device keeps time with the bus: 0x1C32:01 and 0x1C33:01, those that it shows."""
    found = {}
    for index in SYNC_OBJECTS:
        with suppress(SdoAbort):
            found[index] = yield from upload(channel, index, 1)
    return found


def write_types(channel: MailboxChannel, types: Mapping[int, bytes]) -> Procedure[None]:
    """Lets it keep time as it did before a loop asked for clocks, where it lets that be written."""
    for index, kind in types.items():
        try:
            yield from download(channel, index, 1, kind)
        except SdoAbort as abort:
            if abort.code not in LEFT_ALONE:
                raise


def stop(devices: Sequence[DeviceDescription]) -> Procedure[None]:
    """No SYNC signals any more."""
    yield from _write_all(
        devices, [write(EcatCommand.FPWR, d.station_address, ACTIVATION, 0) for d in devices]
    )


def _now(reference: DeviceDescription, epoch_ns: int) -> Procedure[int]:
    """The system time, in full: the low half as the reference says it, near the link's time."""
    [reply] = yield [read(EcatCommand.FPRD, reference.station_address, SYSTEM_TIME_LOW)]
    low = SYSTEM_TIME_LOW.unpack(answered(reply, _station(reference), "its system time"))
    return _near(low, reply.time_ns + epoch_ns)


def _system_time(device: DeviceDescription) -> Request:
    register = SYSTEM_TIME if device.clock_bits == 64 else SYSTEM_TIME_LOW
    return read(EcatCommand.FPRD, device.station_address, register)


def _read_time(reply: Reply, device: DeviceDescription, epoch_ns: int) -> int:
    """In full: a clock of 32 bits near the link's time."""
    value = int.from_bytes(answered(reply, _station(device), "its system time"), "little")
    return value if device.clock_bits == 64 else _near(value, reply.time_ns + epoch_ns)


def _near(low: int, near: int) -> int:
    return near + (low - near + SPAN_32 // 2) % SPAN_32 - SPAN_32 // 2


def _cycle_times(device: DeviceDescription, sync: SyncPlan) -> Request:
    times = struct.pack("<II", sync.cycle_ns, sync.sync1_ns)
    return write(EcatCommand.FPWR, device.station_address, SYNC_CYCLE_TIMES, times)


def _start_time(device: DeviceDescription, sync: SyncPlan, beat_ns: int) -> Request:
    start_ns = beat_ns + sync.shift_ns
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
