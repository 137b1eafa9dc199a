"""Memory of the cycle: no page faults in the native thread, and the amount of locked memory.

Nothing timed is asserted.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from catenary.core import Engine
from catenary.link import Recorder
from catenary.link.frame_memory import FrameMemory
from catenary.virtual import Coupler, Segment
from tests.core.rig import al_status, bench, frame_plan, make_plan

CYCLES = 1000
LOG = 100_000

# Without the right to lock more than the limit, as most users.
LIMITED = """
import os, resource, sys
from catenary.core import Engine
from catenary.virtual import Coupler, Segment
from tests.core.test_memory import make_engine

limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_MEMLOCK, (limit, limit))
try:
    os.setuid(65534)
except OSError:  # in a user namespace root has no such right either
    pass
with Segment([Coupler(), Coupler()], clock="monotonic").open_link() as link:
    engine = make_engine(link)
    engine.start()
    print(engine.scheduling)
    engine.stop()
"""


def make_engine(link: object) -> Engine:
    frames = (frame_plan([al_status(2)]),)
    plan = make_plan([], units=0, frames=frames, priority=None, log_cycles=LOG)
    return Engine(plan, link.capsule)  # type: ignore[attr-defined]


def run(engine: Engine, cycles: int) -> None:
    engine.start()
    engine.run(cycles)
    engine.stop()


def test_the_native_thread_has_no_page_faults() -> None:
    with Segment([Coupler(), Coupler()], clock="monotonic").open_link() as link:
        run(make_engine(link), CYCLES)  # the code, and the memory of the segment
        engine = make_engine(link)
        run(engine, CYCLES)
    assert engine.counters["cycles"] >= CYCLES
    assert engine.counters["page_faults"] == 0


def test_the_native_thread_has_no_page_faults_while_a_recorder_copies_its_frames(
    tmp_path: Path,
) -> None:
    segment = Segment([Coupler(), Coupler()], clock="monotonic")
    with Recorder(segment, tmp_path / "frames.pcapng") as link:
        run(make_engine(link), CYCLES)
        engine = make_engine(link)
        run(engine, CYCLES)
        assert link.recorded >= 2 * CYCLES
    assert engine.counters["page_faults"] == 0


def test_the_native_thread_has_no_page_faults_while_frames_are_kept_in_memory() -> None:
    segment = Segment([Coupler(), Coupler()], clock="monotonic")
    memory = FrameMemory(segment.open_link(), 1 << 20)
    try:
        run(make_engine(memory.link), CYCLES)
        engine = make_engine(memory.link)
        run(engine, CYCLES)
        memory.trim()
        assert memory.link.recorded >= 2 * CYCLES
    finally:
        memory.close()
        memory.release()
    assert engine.counters["page_faults"] == 0


no_mlock = pytest.mark.skipif(
    os.environ.get("CATENARY_SANITIZED") == "address", reason="AddressSanitizer makes mlock a no-op"
)


def scheduling_with_limit(limit: int) -> str:
    command = [sys.executable, "-c", LIMITED, str(limit)]
    path = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@no_mlock
def test_the_cycle_is_locked_first_and_the_log_is_touched_only() -> None:
    text = scheduling_with_limit(4 * 1024 * 1024)
    assert " MB locked, 10 MB touched only (ENOMEM, RLIMIT_MEMLOCK 4 MB: raise `ulimit -l`" in text


@no_mlock
def test_no_right_to_lock_is_no_error() -> None:
    text = scheduling_with_limit(0)
    assert ", 0 kB locked, " in text
    assert "(EPERM, RLIMIT_MEMLOCK 0 kB: raise `ulimit -l`, or grant CAP_IPC_LOCK)" in text


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_nothing_is_locked_in_virtual_time(execution: str) -> None:
    assert bench(execution=execution, units=1).engine.scheduling == "virtual time"
