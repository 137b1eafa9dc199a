"""Scheduling: the obtained settings are reported correctly with any permissions."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from catenary.realtime.system.scheduling import Scheduling, current_scheduling, request_scheduling


def in_another_process(code: str) -> str:
    """Run code in another process, and return its output."""
    start = "from catenary.realtime.system.scheduling import *; import os; "
    done = subprocess.run(
        [sys.executable, "-c", start + code], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_the_default_is_not_real_time():
    now = current_scheduling()
    assert now.policy == "SCHED_OTHER"
    assert not now.real_time
    assert now.cpus == tuple(sorted(os.sched_getaffinity(0)))


def test_a_request_is_granted_or_refused_with_a_reason():
    answer = in_another_process(
        "got = request_scheduling(priority=42); "
        "print(got.real_time or 'SCHED_FIFO 42 refused' in str(got), "
        "got.memory_locked or 'mlockall refused' in str(got), "
        "(got.policy, got.priority) == "
        "(current_scheduling().policy, current_scheduling().priority))"
    )
    assert answer == "True True True"


def test_one_cpu():
    cpu = max(os.sched_getaffinity(0))
    assert in_another_process(f"print(request_scheduling(cpu={cpu}).cpus)") == f"({cpu},)"


def test_an_unknown_cpu_is_refused():
    answer = in_another_process("print(request_scheduling(cpu=1000).refusals[0])")
    assert answer.startswith("CPU 1000 refused (")


def test_an_invalid_priority_is_an_error():
    with pytest.raises(ValueError, match=r"priority 100 is not within 1\.\.99"):
        request_scheduling(priority=100)


def test_scheduling_as_text():
    obtained = Scheduling("SCHED_FIFO", 80, True, (1,))
    assert str(obtained) == "SCHED_FIFO 80, memory locked, CPU 1"
    refused = Scheduling("SCHED_OTHER", 0, False, (0, 1), ("mlockall refused (no memory)",))
    assert str(refused) == (
        "SCHED_OTHER, memory not locked, CPUs 0,1, mlockall refused (no memory)"
    )
