"""Scheduling of threads while a loop runs."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable

import pytest

from catenary.bus.thread_priority import BEHIND, leave_real_time, step_behind


def scheduling_of_a_thread_started_with(
    policy: int, priority: int, change: Callable[[], None] = step_behind
) -> tuple[int, int]:
    """Return policy and priority after `change`."""
    found: list[tuple[int, int]] = []

    def inner() -> None:
        change()
        found.append((os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))

    def outer() -> None:
        try:
            os.sched_setscheduler(0, policy, os.sched_param(priority))
        except PermissionError:
            return
        thread = threading.Thread(target=inner)
        thread.start()
        thread.join()

    thread = threading.Thread(target=outer)
    thread.start()
    thread.join()
    if not found:
        pytest.skip("needs real-time scheduling")
    return found[0]


@pytest.mark.parametrize("policy", [os.SCHED_FIFO, os.SCHED_RR])
def test_a_thread_does_not_keep_the_priority_of_the_loop(policy: int) -> None:
    assert scheduling_of_a_thread_started_with(policy, 80) == (os.SCHED_FIFO, BEHIND)


def test_a_thread_of_an_ordinary_program_keeps_its_scheduling() -> None:
    assert scheduling_of_a_thread_started_with(os.SCHED_OTHER, 0) == (os.SCHED_OTHER, 0)


def test_a_thread_for_requests_is_an_ordinary_one() -> None:
    found = scheduling_of_a_thread_started_with(os.SCHED_FIFO, 80, leave_real_time)
    assert found == (os.SCHED_OTHER, 0)
