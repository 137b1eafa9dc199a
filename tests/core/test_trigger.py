"""Triggers between loops: the memory, the wait, and what an engine refuses."""

from __future__ import annotations

import ctypes
import mmap
import struct

import pytest

from catenary.core import TRIGGER_SIZE, TriggerBlock
from tests.core.hammer import load_hammer
from tests.core.rig import axis, bench


def test_no_wake_up_is_lost() -> None:
    assert load_hammer().hammer_trigger(ctypes.c_uint64(20_000)) == 0


def test_the_memory_is_checked_and_read() -> None:
    with pytest.raises(ValueError, match="64 bytes"):
        TriggerBlock(bytearray(TRIGGER_SIZE - 1))
    memory = mmap.mmap(-1, 4096)
    with pytest.raises(ValueError, match="multiple of 64"):
        TriggerBlock(memoryview(memory)[8:])
    with pytest.raises(BufferError):
        TriggerBlock(bytes(TRIGGER_SIZE))
    block = TriggerBlock(memory)
    assert (block.ticks, block.scheduled_ns, block.period_ns) == (0, 0, 0)
    memory[:24] = struct.pack("<IIqQ", 3, 1, 5_000, 1_000)
    assert (block.ticks, block.scheduled_ns, block.period_ns) == (3, 5_000, 1_000)


@pytest.mark.parametrize("sends", [False, True])
def test_virtual_time_has_no_triggers(sends: bool) -> None:
    made = bench(axis(0))
    made.engine.stop()
    with pytest.raises(ValueError, match="real time"):
        made.engine.set_trigger(TriggerBlock(mmap.mmap(-1, 4096)), sends)
    assert not made.engine.following
