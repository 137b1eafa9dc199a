"""Devices in SAFE-OP or OP, left there by a killed master or controlled by an active one.

The process-data watchdog distinguishes the two cases: it expires unless a master refreshes the
outputs (ETG.1000.4 §6.3; ET1100 datasheet, section II, 0x0420 and 0x0440). Devices are addressed by
position (APRD), because they may not have station addresses yet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.procedure.exchange import Procedure, Reply, Request, after, physical, read
from catenary.wire.al import ERROR_FLAG, STATE_MASK, AlState
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import (
    AL_STATUS,
    SYNC_MANAGER_COUNT,
    SYNC_MANAGERS_SUPPORTED,
    WATCHDOG_DIVIDER,
    WATCHDOG_STATUS_PROCESS_DATA,
    WATCHDOG_TIME_PROCESS_DATA,
    sync_manager,
    watchdog_unit_ns,
)
from catenary.wire.sync_manager import SIZE, Activation, Direction, decode_sync_manager

RUNNING = (AlState.SAFE_OP, AlState.OP)
ACTIVE = 0x01  # 0x0440: the watchdog has not expired or is disabled
POLL = 0.010  # [s] between two checks
LONGEST_NS = 5_000_000_000  # longest wait, twice a watchdog time; longer watchdogs are not checked


class Running(NamedTuple):
    """A device that was found in SAFE-OP or OP."""

    position: int
    state: AlState
    error: bool
    sync_managers: int  # number of SyncManagers

    def __str__(self) -> str:
        return f"device {self.position} in {self.state}{' with an error' * self.error}"


def find_running(device_count: int) -> Procedure[list[Running]]:
    """Return the devices in SAFE-OP or OP. Nothing is written.

    In a cut ring, two devices at the same distance from both ends answer together. They are
    omitted.
    """
    replies = yield [
        read(EcatCommand.APRD, -position, register)
        for position in range(device_count)
        for register in (AL_STATUS, SYNC_MANAGERS_SUPPORTED)
    ]
    found = []
    for position in range(device_count):
        status, supported = replies[2 * position : 2 * position + 2]
        word = AL_STATUS.unpack(status.data)
        if _answers(status) and word & STATE_MASK in RUNNING:
            count = SYNC_MANAGERS_SUPPORTED.unpack(supported.data)
            state, error = AlState(word & STATE_MASK), bool(word & ERROR_FLAG)
            found.append(Running(position, state, error, count))
    return found


def find_refreshed(running: Sequence[Running]) -> Procedure[list[int]]:
    """Return the positions of devices in OP whose outputs a master refreshes. Nothing is written.

    The search ends when the first such device is found, so others may be missing from the result.
    It takes at most twice the longest watchdog time. Only devices whose outputs trigger an
    enabled watchdog are checked. Devices in SAFE-OP are not checked, because a watchdog that was
    never triggered looks active.
    """
    watched = {}
    for device in running:
        if device.state is AlState.OP:
            time_ns = yield from _watchdog_time(device)
            if time_ns:
                watched[device.position] = time_ns
    start: int | None = None
    refreshed: list[int] = []
    while watched and not refreshed:
        replies = yield [
            read(EcatCommand.APRD, -position, WATCHDOG_STATUS_PROCESS_DATA) for position in watched
        ]
        start = replies[0].time_ns if start is None else start
        for position, reply in zip(list(watched), replies, strict=True):
            status = WATCHDOG_STATUS_PROCESS_DATA.unpack(reply.data)
            if not _answers(reply) or not status & ACTIVE:
                del watched[position]
            elif reply.time_ns - start >= 2 * watched[position]:
                refreshed.append(position)
        yield after(POLL)
    return refreshed


def _watchdog_time(device: Running) -> Procedure[int]:
    """Return the watchdog time of a device [ns]; 0 if the device cannot be checked.

    This is the case if the watchdog is disabled or too long, if no outputs trigger it, or if the
    device does not answer.
    """
    count = min(device.sync_managers, SYNC_MANAGER_COUNT)
    replies = yield [
        read(EcatCommand.APRD, -device.position, WATCHDOG_DIVIDER),
        read(EcatCommand.APRD, -device.position, WATCHDOG_TIME_PROCESS_DATA),
        Request(
            EcatCommand.APRD,
            physical(-device.position, sync_manager(0).address),
            bytes(max(count, 1) * SIZE),
            True,
        ),
    ]
    if not all(map(_answers, replies)) or not _triggers(replies[2].data):
        return 0
    divider = WATCHDOG_DIVIDER.unpack(replies[0].data)
    time_ns = watchdog_unit_ns(divider) * WATCHDOG_TIME_PROCESS_DATA.unpack(replies[1].data)
    return time_ns if 2 * time_ns <= LONGEST_NS else 0


def _triggers(blocks: bytes) -> bool:
    """Return True if a SyncManager of outputs is enabled and triggers the watchdog."""
    for start in range(0, len(blocks), SIZE):
        try:
            each = decode_sync_manager(blocks[start : start + SIZE])
        except DecodeError:
            continue
        writes = each.control.direction is Direction.WRITE and each.length > 0
        if writes and each.control.watchdog and each.activation & Activation.ENABLE:
            return True
    return False


def _answers(reply: Reply) -> bool:
    """Return True if exactly one device has answered."""
    return not reply.lost and reply.working_counter == 1
