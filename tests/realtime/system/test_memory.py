"""Shared memory starts as zeros, and is freed with its last user."""

from __future__ import annotations

import gc
import os

import pytest

from catenary.realtime.system.memory import SharedMemory


def test_starts_as_zeros():
    assert bytes(SharedMemory(10000).buffer) == bytes(10000)


def test_memory_is_freed():
    gc.collect()
    before = len(os.listdir("/proc/self/fd"))
    memory = SharedMemory(4096)
    assert len(os.listdir("/proc/self/fd")) > before
    del memory
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) == before


def test_refuses_a_size_of_zero():
    with pytest.raises(ValueError, match="size of 0 bytes"):
        SharedMemory(0)
