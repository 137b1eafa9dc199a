"""Shared memory: zeros, and gone with its last user."""

from __future__ import annotations

import gc
import os

import pytest

from catenary.realtime.system.memory import SharedMemory


def test_is_zeros_at_first():
    assert bytes(SharedMemory(10000).buffer) == bytes(10000)


def test_nothing_is_left_behind():
    gc.collect()
    before = len(os.listdir("/proc/self/fd"))
    memory = SharedMemory(4096)
    assert len(os.listdir("/proc/self/fd")) > before
    del memory
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) == before


def test_refuses_none():
    with pytest.raises(ValueError, match="size of 0 bytes"):
        SharedMemory(0)
