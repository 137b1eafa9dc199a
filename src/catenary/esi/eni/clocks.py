"""SYNC signals of the devices of an ENI."""

from __future__ import annotations

from typing import NamedTuple

from catenary.esi.eni.settings import ASSIGN_ACTIVATE, written
from catenary.esi.eni.values import EniDevice
from catenary.wire import register

NANOSECOND = 1e-9


class SyncSignals(NamedTuple):
    """SYNC signals of a device. Times are in seconds."""

    assign_activate: int  # registers 0x0980 (low byte) and 0x0981
    sync0: float
    sync1: float
    shift: float


def sync_signals(device: EniDevice) -> SyncSignals | None:
    """Return the SYNC signals of a device; None if it does not use them.

    The commands of the transition PS count more than the element DC, because they are what the
    configurator wants to be written.

    Args:
        device: The device.
    """
    word = written(device, ASSIGN_ACTIVATE, "PS")
    byte = written(device, register.ACTIVATION.address, "PS")
    assign = 0
    if word is not None and len(word.data) >= 2:
        assign = int.from_bytes(word.data[:2], "little")
    elif byte is not None:
        assign = byte.data[0] << 8
    if not assign:
        return None
    clock = device.clock
    sync0 = 0.0 if clock is None else clock.sync0
    sync1 = 0.0 if clock is None else clock.sync1
    times = written(device, register.SYNC_CYCLE_TIMES.address, "PS")
    if times is not None and len(times.data) >= 4:
        sync0 = int.from_bytes(times.data[:4], "little") * NANOSECOND
        if len(times.data) >= 8:
            sync1 = int.from_bytes(times.data[4:8], "little") * NANOSECOND
    return SyncSignals(assign, sync0, sync1, 0.0 if clock is None else clock.shift)
