"""Laws in the cycle: hand-over and end, in every execution mode and in virtual time."""

import ctypes
import gc
import os
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from catenary.core import (
    CYCLE_LAW_DONE,
    CYCLE_LAW_FAILED,
    CYCLE_LIMITED,
    LAW_FINISHED,
    LAW_NEVER_RETURNED,
    LAW_NOT_FINITE,
    LAW_OVERRUN,
    LAW_RAISED,
    LAW_RUNNING,
    LAW_STOPPED,
    REQUEST_ENABLED,
    Engine,
    Law,
)
from catenary.plan.cycle import AxisLimits, Bank, Column
from catenary.virtual import Coupler, Segment
from tests.core.rig import (
    CST,
    DRIVE_SIZE,
    MS,
    PERIOD,
    Bench,
    ScriptedDrive,
    al_status,
    axis,
    bench,
    frame_plan,
    make_plan,
    number,
)

EXECUTION_MODES = ("threaded", "inline")
DOUBLES = ctypes.POINTER(ctypes.c_double)
STEP = ctypes.CFUNCTYPE(
    ctypes.c_int,
    *(ctypes.c_void_p, ctypes.c_void_p),
    *(DOUBLES, ctypes.c_int64, DOUBLES, ctypes.c_int64),
    ctypes.c_double,
)


@dataclass
class Frame:
    """What a law sees."""

    actual: np.ndarray
    target: np.ndarray
    memory: ctypes._Pointer
    parameters: ctypes._Pointer
    time: float


def record(fields: dict, size: int) -> np.dtype:
    return np.dtype(
        {
            "names": list(fields),
            "offsets": [offset for offset, _, _ in fields.values()],
            "formats": [f if count is None else (f, (count,)) for _, f, count in fields.values()],
            "itemsize": size,
        }
    )


def make_law(
    b: Bench,
    body: Callable[[Frame], int],
    *,
    memory: list[float] | None = None,
    parameters: list[float] | None = None,
    budget_ns: int = 0,
    overrun_limit: int = 3,
) -> Law:
    actual, target = (
        record(fields, len(block))
        for fields, block in zip(b.engine.law_fields(), b.engine.blocks(), strict=True)
    )

    def step(a: int, t: int, m: ctypes._Pointer, nm: int, p: ctypes._Pointer, np_: int, time):
        views = [
            np.frombuffer((ctypes.c_char * dtype.itemsize).from_address(at), dtype)[0]
            for at, dtype in ((a, actual), (t, target))
        ]
        return body(Frame(*views, m, p, time))

    callback = STEP(step)
    law = Law(
        ctypes.cast(callback, ctypes.c_void_p).value,
        memory or [],
        parameters or [],
        budget_ns=budget_ns,
        overrun_limit=overrun_limit,
        priority=0,
    )
    KEPT.append(callback)
    return law


KEPT: list[object] = []  # ctypes callbacks live as long as the tests


def spring(frame: Frame) -> int:
    frame.target["torque"][0] = -0.5 * frame.actual["position"][0]
    return 0


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_law_acts_on_the_inputs_of_its_own_cycle_and_no_cycle_is_lost(execution: str) -> None:
    b = bench(axis(0, mode=CST), execution=execution)
    b.ask(REQUEST_ENABLED)
    b.engine.run(10)
    assert b.drives[0].state == 1  # a brake does not open before somebody holds the load
    b.engine.start_law(make_law(b, spring))
    b.steps(9)
    assert b.axis_flags[0] & 1
    b.drives[0].position = 2000
    b.steps(2)  # one frame to see it, one to act
    assert b.drives[0].target_torque == -1000
    b.engine.stop_law()
    b.steps(3)
    assert b.engine.counters["lost"] == 0


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_law_sees_what_it_was_promised(execution: str) -> None:
    b = bench(axis(0), axis(1), execution=execution)
    b.enable()
    seen: list[tuple] = []

    def look(frame: Frame) -> int:
        a = frame.actual
        seen.append((int(a["n"]), bool(a["ok"]), float(a["dt"]), list(a["enabled"]), frame.time))
        return 0

    b.engine.start_law(make_law(b, look))
    b.steps(4)
    times = [time for *_, time in seen]
    assert times == pytest.approx([k * PERIOD * 1e-9 for k in range(len(times))])
    assert {tuple(map(str, entry[:3])) for entry in seen} == {("2", "True", str(PERIOD * 1e-9))}
    assert all(entry[3] == [1, 1] for entry in seen)


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_the_limits_hold_for_laws_too(execution: str) -> None:
    def wild(frame: Frame) -> int:
        frame.target["torque"][0] = 99.0
        return 0

    limits = AxisLimits(torque=2.0)
    b = bench(axis(0, mode=CST, limits=limits, torque_slope=100.0), execution=execution)
    b.ask(REQUEST_ENABLED)
    b.engine.start_law(make_law(b, wild))
    assert b.steps(20) & CYCLE_LIMITED
    assert b.drives[0].target_torque == 2000


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_finished_law_leaves_the_axes_holding_and_python_where_it_ended(execution: str) -> None:
    def until_soon(frame: Frame) -> int:
        frame.target["position"][0] += 0.001
        return frame.time > 0.03

    b = bench(axis(0), execution=execution)
    b.enable()
    b.target_position[0] = -0.5  # committed before: must not come back
    b.engine.next()
    law = make_law(b, until_soon)
    b.engine.start_law(law)
    for _ in range(60):
        b.engine.next()
        if law.ended:
            break
    assert law.status == LAW_FINISHED
    assert b.target_position[0] == pytest.approx(b.drives[0].target_position * 1e-3, abs=2e-3)
    asked, before = b.target_position[0], b.drives[0].target_position
    speeds = []
    for _ in range(400):
        b.engine.next()
        speeds.append(b.drives[0].target_position - before)
        before = b.drives[0].target_position
    assert np.abs(np.diff(speeds)).max() <= 1  # no jump: 1 rad/s decelerates at 25 rad/s²
    assert speeds[-1] == 0
    assert before == round(asked * 1e3)
    assert b.drives[0].state == 4


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_run_law_continues_until_the_end_of_the_law(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.enable()
    law = make_law(b, lambda frame: frame.time > 0.02)
    b.engine.start_law(law)
    flags = 0
    while not law.ended:
        flags = b.engine.run_law(10 * MS, CYCLE_LAW_FAILED)
    assert flags & CYCLE_LAW_DONE
    assert law.figures["steps"] == pytest.approx(0.02 / (PERIOD * 1e-9), abs=2)


def failing(b: Bench, body: Callable[[Frame], int], **more: int) -> tuple[Law, int]:
    """Runs a law until it has failed."""
    b.enable()
    law = make_law(b, body, **more)
    b.engine.start_law(law)
    for _ in range(50):
        flags = b.engine.next()
        if law.ended:
            return law, flags
    raise AssertionError("the law did not fail")


@pytest.mark.parametrize("execution", EXECUTION_MODES)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_a_target_that_is_no_number_stops_the_drives(execution: str, value: float) -> None:
    def breaks(frame: Frame) -> int:
        frame.target["position"][1] = value if frame.time > 0.01 else frame.target["position"][1]
        return 0

    b = bench(axis(0), axis(1), execution=execution)
    law, flags = failing(b, breaks)
    assert flags & CYCLE_LAW_FAILED
    assert (law.status, law.axis) == (LAW_NOT_FINITE, 1)
    b.steps(10)
    assert [drive.state for drive in b.drives] != [4, 4]  # both: a law is one
    assert all(np.isfinite(b.target_position))


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_what_a_failed_step_has_half_written_is_not_sent(execution: str) -> None:
    valve = Column("valve", number(DRIVE_SIZE, 8), Bank.INTEGER, 1, 0)
    drives = [ScriptedDrive(), ScriptedDrive()]
    plan = replace(make_plan([axis(0)], units=2, execution=execution), output_columns=(valve,))
    b = Bench(plan, drives)

    def breaks(frame: Frame) -> int:
        frame.target["integers"][0] = 77 if frame.time > 0.01 else 5
        return -1 if frame.time > 0.01 else 0

    law, _flags = failing(b, breaks)
    assert law.status == LAW_RAISED
    assert drives[1].controlword == 5
    b.steps(5)
    assert drives[0].state != 4


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_one_long_step_is_counted_several_in_a_row_stop(execution: str) -> None:
    b = bench(axis(0), execution=execution)

    def slow(frame: Frame) -> int:
        if frame.time in (0.0, PERIOD * 1e-9) or frame.time > 0.01:
            b.link.time += 200_000
        return 0

    law, flags = failing(b, slow, budget_ns=100_000, overrun_limit=3)
    assert flags & CYCLE_LAW_FAILED
    assert law.status == LAW_OVERRUN
    assert law.figures["overruns"] == 5
    assert law.figures["longest_ns"] == 200_000


def test_memory_and_parameters_change_all_at_once_and_can_be_read_back() -> None:
    b = bench(axis(0), execution="threaded")
    b.enable()

    def count(frame: Frame) -> int:
        frame.memory[0] += frame.parameters[0]
        frame.memory[1] = frame.parameters[1]
        return 0

    law = make_law(b, count, memory=[10.0, 0.0], parameters=[1.0, -1.0])
    assert law.memory == [10.0, 0.0]
    b.engine.start_law(law)
    b.steps(4)
    before = law.memory
    assert before[0] > 10.0
    law.set_parameters([2.0, -2.0])
    b.steps(1)
    assert law.memory == [before[0] + 2.0, -2.0]
    law.set_memory([0.5, 0.0])
    b.steps(1)
    assert law.memory == [2.5, -2.0]
    with pytest.raises(ValueError, match="expected 2 numbers, received 3"):
        law.set_parameters([1.0, 2.0, 3.0])


def test_numbers_set_during_a_conversion_are_not_mixed() -> None:
    b = bench(axis(0), execution="threaded")
    b.enable()
    law = make_law(b, lambda frame: 0, memory=[1.0])

    class Meddler:
        def __float__(self) -> float:
            law.set_memory([2.0])
            return 3.0

    b.engine.start_law(law)
    law.set_memory([Meddler()])
    b.steps(3)
    assert law.memory == [3.0]


def test_a_law_can_be_stopped_and_another_started() -> None:
    b = bench(axis(0), execution="threaded")
    b.enable()
    first, second = make_law(b, lambda frame: 0), make_law(b, lambda frame: 0)
    b.engine.start_law(first)
    b.steps(3)
    assert first.status == LAW_RUNNING
    b.engine.start_law(second)
    b.steps(3)
    assert (first.status, second.status) == (LAW_STOPPED, LAW_RUNNING)
    b.engine.stop_law()
    b.steps(3)
    assert second.status == LAW_STOPPED
    b.target_position[0] = 0.002
    b.steps(3)
    assert b.drives[0].target_position == 2


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_of_two_requests_in_one_cycle_the_last_one_is_served(execution: str) -> None:
    b = bench(axis(0), execution=execution)
    b.enable()
    first, second, third = (make_law(b, lambda frame: 0) for _ in range(3))
    b.engine.start_law(first)
    b.engine.start_law(second)
    b.steps(3)
    assert (first.status, second.status) == (LAW_STOPPED, LAW_RUNNING)
    b.engine.start_law(third)
    b.engine.stop_law()
    b.steps(3)
    assert (second.status, third.status) == (LAW_STOPPED, LAW_STOPPED)
    assert third.figures["steps"] == 0


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = Path(tmp_path_factory.mktemp("endless"))
    source = folder / "endless.c"
    source.write_text(
        "int endless(const void *a, void *t, double *m, long n, const double *p, long k,"
        " double time) {\n"
        "    volatile double x = 0;\n"
        "    while (time >= 0.005) x += time;\n"
        "    return 0;\n"
        "}\n"
    )
    library = folder / "endless.so"
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", library, source], check=True)
    return ctypes.CDLL(str(library))


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_law_that_never_returns_is_aborted_and_the_bus_continues(
    execution: str, endless: ctypes.CDLL
) -> None:
    b = bench(axis(0), execution=execution)
    b.enable()
    address = ctypes.cast(endless.endless, ctypes.c_void_p).value
    law = Law(address, [], [], budget_ns=0, overrun_limit=3, priority=0)
    b.engine.start_law(law)
    for _ in range(20):
        flags = b.engine.next()
        if law.ended:
            break
    assert flags & CYCLE_LAW_FAILED
    assert law.status == LAW_NEVER_RETURNED
    b.steps(5)
    assert b.drives[0].state != 4
    assert b.engine.counters["lost"] == 0
    again = Law(address, [], [], budget_ns=0, overrun_limit=3, priority=0)
    assert again.rehearse(b"\0" * 64, b"\0" * 64) == 0  # its first steps do return


# ---- the monitor


def threads() -> set[str]:
    return set(os.listdir("/proc/self/task"))


def wake_ups(thread: str) -> int:
    status = Path(f"/proc/self/task/{thread}/status").read_text()
    return int(status.partition("voluntary_ctxt_switches:")[2].split()[0])


def compute(seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def is_asleep(thread: str) -> bool:
    """It does not wake up within several checks. It may need one more check to fall asleep."""
    for _ in range(50):
        before = wake_ups(thread)
        compute(0.03)
        if wake_ups(thread) == before:
            return True
    return False


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_the_laws_of_an_engine_share_one_monitor_that_sleeps_while_none_runs(
    execution: str,
) -> None:
    b = bench(axis(0), execution=execution)
    b.enable()
    before = threads()
    laws = [make_law(b, lambda frame: 0) for _ in range(3)]
    assert threads() <= before  # a thread of a former test may end
    for law in laws:
        b.engine.start_law(law)
        b.steps(2)
        assert law.status == LAW_RUNNING
        [monitor] = threads() - before
    b.engine.stop_law()
    b.steps(2)
    assert is_asleep(monitor)
    b.engine.start_law(make_law(b, lambda frame: 0))
    b.steps(2)
    asleep = wake_ups(monitor)
    while wake_ups(monitor) < asleep + 3:
        pass
    del b
    gc.collect()
    assert threads() <= before  # a thread of a former test may end


def test_a_law_after_a_restart_is_given_up_in_its_new_thread(endless: ctypes.CDLL) -> None:
    """A new native thread may have the handle of the former one."""
    address = ctypes.cast(endless.endless, ctypes.c_void_p).value
    with Segment([Coupler()], clock="monotonic").open_link() as link:
        frames = (frame_plan([al_status(1)]),)
        plan = make_plan([], units=0, frames=frames, priority=None)
        engine = Engine(plan, link.capsule)
        for _ in range(3):
            engine.start()
            engine.run(1)
            law = Law(address, [], [], budget_ns=0, overrun_limit=3, priority=0)
            engine.start_law(law)
            while not law.wait(10**9):
                pass
            engine.stop()
            assert law.status == LAW_NEVER_RETURNED


def test_a_late_cycle_that_leaves_the_law_no_time_is_skipped_instead_of_lost() -> None:
    b = bench(axis(0))
    b.enable()
    b.engine.start_law(make_law(b, lambda frame: 0, budget_ns=400_000))
    b.steps(5)
    wait = b.link.table_wait_until
    late = [600_000]  # the frames are back after 700 us, the law needs the last 450 us

    def oversleep(_, deadline, wake_on_frame) -> int:
        result = wait(_, deadline, wake_on_frame)
        if not wake_on_frame:
            b.link.time += late.pop() if late else 0
        return result

    b.link.table.wait_until = type(b.link.table.wait_until)(oversleep)
    b.steps(3)
    assert b.engine.counters["lost"] == 0
    assert b.engine.counters["late"] == 1


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_the_last_targets_of_a_law_are_sent_as_they_are(execution: str) -> None:
    """The torque slope shapes the return to the application's set-points only."""

    def body(frame: Frame) -> int:
        frame.target["torque"][0] = 0.8 if frame.time > 0.015 else 0.5
        return frame.time > 0.015

    b = bench(axis(0, mode=CST, torque_slope=10.0), execution=execution)
    b.ask(REQUEST_ENABLED)
    b.engine.start_law(make_law(b, body))
    b.steps(25)
    assert b.drives[0].target_torque == 800


@pytest.mark.parametrize("starts", [True, False])
def test_a_waiting_call_of_an_inline_loop_keeps_the_axes_enabled(starts: bool) -> None:
    """Its native cycles must not take the requests of an older commit over."""
    b = bench(axis(0), execution="inline")
    b.enable()
    b.steps(3)
    if starts:
        b.engine.start_law(make_law(b, lambda _: 0))
    else:
        b.engine.stop_law()
    for _ in range(10):
        b.engine.run(1)
        assert b.drives[0].controlword == 0x0F


def test_the_first_step_in_an_inline_loop_sees_an_estimated_velocity() -> None:
    seen: list[float] = []

    def body(frame: Frame) -> int:
        seen.append(float(frame.actual["velocity"][0]))
        frame.target["position"][0] += 0.002
        return 0

    b = bench(axis(0, actual_velocity=None), execution="inline")
    b.enable()
    for _ in range(10):
        b.target_position[0] += 0.002
        b.engine.next()
    b.target_position[0] += 0.002
    b.engine.start_law(make_law(b, body))
    b.steps(6)
    assert seen == pytest.approx([2.0] * len(seen))
