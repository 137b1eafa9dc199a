"""A loop in the background: a thread iterates it, the program updates targets and waits.

Virtual time keeps to the wall clock there. Nothing here depends on how fast it is: every wait ends
as soon as its condition holds.
"""

import asyncio
import ctypes
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

import catenary as cat
from catenary.errors import CatenaryError, DriveError, LoopError, MoveError
from catenary.loop.session import Session
from catenary.realtime import VirtualClock
from catenary.types import SINT
from catenary.virtual import Segment, Servo

PATIENCE = 10.0  # [s]
COUNTS = 2**20


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(1e-3)


@dataclass
class Condition:
    """Something to wait for."""

    condition: Callable[[], object]
    error: CatenaryError | None = None
    patience: float = PATIENCE
    stopped: bool = False

    @property
    def done(self) -> bool:
        return bool(self.condition())

    def stop(self) -> None:
        self.stopped = True

    def timeout_error(self, timeout: float) -> MoveError:
        return MoveError(f"late after {timeout:g} s", axis="", remaining=0.0)


class Cell:
    """A segment, its drives and an open loop."""

    def __init__(self, mode: str, servos: int = 2, **options: object) -> None:
        self.segment = Segment([Servo() for _ in range(servos)])
        self.main = cat.MainDevice(self.segment)
        self.main.open()
        self.arm = cat.Drives(
            self.main.scan().drives, mode=mode, counts_per_turn=COUNTS, velocity_limit=10.0
        )
        self.loop = cat.Loop(self.arm, **options).open()  # type: ignore[arg-type]

    @property
    def cycles(self) -> int:
        return self.loop.timing.counters["cycles"]

    def pass_cycles(self, count: int) -> None:
        until(lambda last=self.cycles + count: self.cycles >= last)

    def moved(self, axis: int) -> bool:
        return abs(self.arm.actual.position[axis] - self.start[axis]) > 0.01

    def forget(self) -> None:
        del self.loop
        gc.collect()

    def run_in_background(self) -> None:
        self.start = self.arm.actual.position.copy()
        self.loop.run_in_background()


@pytest.fixture
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    cell = Cell(getattr(request, "param", "csp"))
    cell.run_in_background()
    yield cell
    cell.loop.close()
    cell.main.close()


csv = pytest.mark.parametrize("cell", ["csv"], indirect=True)
cst = pytest.mark.parametrize("cell", ["cst"], indirect=True)


# ---- updates


def test_an_update_is_sent_when_the_block_ends(cell: Cell) -> None:
    with cell.loop.update():
        cell.arm.target.position[:] = cell.start + 0.05
        cell.pass_cycles(20)
        assert not cell.moved(0)
    cell.loop.wait(Condition(lambda: cell.moved(0) and cell.moved(1)))


def test_an_update_that_raises_sends_nothing(cell: Cell) -> None:
    def spoilt() -> None:
        with cell.loop.update():
            cell.arm.target.position[0] += 0.05
            cell.arm.disable(1)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        spoilt()
    assert cell.arm.target.position == pytest.approx(cell.start, abs=1e-3)
    cell.pass_cycles(50)
    assert not cell.moved(0)
    assert cell.arm.enabled.all()


def test_requests_take_effect_without_an_update(cell: Cell) -> None:
    cell.arm.quick_stop()
    until(lambda: not cell.arm.enabled.any())


def test_updates_of_several_threads_follow_each_other(cell: Cell) -> None:
    seen: list[bool] = []

    def move(sign: float) -> None:
        for k in range(20):
            with cell.loop.update():
                cell.arm.target.position[:] = cell.start + sign * k * 1e-3
                same = np.ptp(cell.arm.target.position - cell.start)
            seen.append(bool(same < 1e-9))

    threads = [threading.Thread(target=move, args=(sign,)) for sign in (1, -1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert seen == [True] * 40


@csv
def test_velocities_expire_if_the_program_is_stuck(cell: Cell) -> None:
    with cell.loop.update():
        cell.arm.target.velocity[:] = 1.0
    until(lambda: cell.moved(0))
    until(lambda: np.abs(cell.arm.actual.velocity).max() < 1e-3)  # nothing was updated meanwhile
    assert cell.arm.target.velocity.tolist() == [0.0, 0.0]
    assert cell.arm.enabled.all()
    with cell.loop.update():
        cell.arm.target.velocity[:] = 1.0
    until(lambda: (cell.arm.actual.velocity > 0.5).all())


@cst
def test_torques_that_are_not_updated_stop_the_axis_and_the_loop(cell: Cell) -> None:
    with cell.loop.update():
        cell.arm.target.torque[:] = 0.01
    until(lambda: cell.loop.error is not None)
    with pytest.raises(DriveError, match=r"older than command_timeout \(20 ms in CST\)"):
        cell.loop.close()


def test_a_longer_command_timeout() -> None:
    cell = Cell("csv", 1, stop=cat.StopPolicy(command_timeout=1e6))
    cell.run_in_background()
    with cell.loop.update():
        cell.arm.target.velocity[:] = 1.0
    cell.pass_cycles(400)
    assert cell.arm.actual.velocity[0] > 0.5
    cell.loop.close()
    cell.main.close()


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("inf"), float("nan")])
def test_no_command_timeout(timeout: float) -> None:
    with pytest.raises(ValueError, match="command_timeout"):
        cat.StopPolicy(command_timeout=timeout)


# ---- waiting


def test_wait_raises_the_error_of_the_move(cell: Cell) -> None:
    with pytest.raises(DriveError, match="is lost"):
        cell.loop.wait(Condition(lambda: True, DriveError("is lost")))


def test_wait_has_a_timeout(cell: Cell) -> None:
    never = Condition(lambda: False)
    with pytest.raises(MoveError, match=r"late after 0\.05 s"):
        cell.loop.wait(never, timeout=0.05)
    assert never.stopped


def test_wait_ends_when_another_thread_closes_the_loop(cell: Cell) -> None:
    errors: list[BaseException] = []

    def wait() -> None:
        try:
            cell.loop.wait(Condition(lambda: False))
        except RuntimeError as error:
            errors.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    cell.pass_cycles(5)
    cell.loop.close()
    thread.join(PATIENCE)
    assert "the loop is closed" in str(errors[0])


def test_asyncio_waits_in_a_thread(cell: Cell) -> None:
    async def move() -> None:
        with cell.loop.update():
            cell.arm.target.position[:] = cell.start + 0.05
        await asyncio.gather(
            *(
                asyncio.to_thread(
                    cell.loop.wait,
                    Condition(lambda axis=axis: cell.moved(axis)),
                )
                for axis in range(2)
            )
        )

    asyncio.run(move())
    assert cell.moved(0)
    assert cell.moved(1)


def test_objects_are_read_while_the_loop_runs(cell: Cell) -> None:
    assert cell.main.subs[0].sdo.read(0x6061, 0, type=SINT) == 8


# ---- errors


def test_an_error_closes_the_loop_and_the_next_call_raises_it(cell: Cell) -> None:
    cell.segment[0].inject_fault(0x2310)
    until(lambda: cell.loop.error is not None)
    until(lambda: cell.segment[1].state & 0x0F == 2)  # left as by a with block
    with pytest.raises(DriveError, match="0x2310"):
        cell.loop.wait(Condition(lambda: False))
    with pytest.raises(DriveError, match="0x2310"), cell.loop.update():
        raise AssertionError
    with pytest.raises(DriveError, match="0x2310"):
        cell.loop.run_in_background()
    cell.loop.close()  # it was raised before
    assert isinstance(cell.loop.error, DriveError)


def test_close_raises_an_error_that_no_call_has_raised(cell: Cell) -> None:
    cell.segment[0].inject_fault(0x2310)
    until(lambda: cell.loop.error is not None)
    with pytest.raises(DriveError, match="0x2310"):
        cell.loop.close()
    cell.loop.close()


def test_an_update_in_which_the_loop_ends_raises_its_error(cell: Cell) -> None:
    def update() -> None:
        with cell.loop.update():
            cell.segment[0].inject_fault(0x2310)
            until(lambda: cell.loop.error is not None)

    with pytest.raises(DriveError, match="0x2310"):
        update()


def test_an_update_that_ends_while_the_loop_is_left_changes_nothing(cell: Cell) -> None:
    """What leaving has requested stays: the restored targets would enable the axes again."""
    entered, written = threading.Event(), threading.Event()
    errors: list[str] = []

    def update() -> None:
        try:
            with cell.loop.update():
                entered.set()
                written.wait(PATIENCE)
        except RuntimeError as error:
            errors.append(str(error))

    thread = threading.Thread(target=update)
    thread.start()
    assert entered.wait(PATIENCE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("catenary.loop.background.LEAVE_TIMEOUT", 0.01)
        cell.loop.close()
    goals = cell.loop._sessions[0].views.requested_state.tolist()
    written.set()
    thread.join(PATIENCE)
    assert errors == ["the loop is closed: open it again, or use it in a with block"]
    assert cell.loop._sessions[0].views.requested_state.tolist() == goals


def test_a_with_block_raises_the_error_at_its_end() -> None:
    segment = Segment([Servo()])

    def run() -> None:
        with cat.Loop(arm) as loop:
            loop.run_in_background()
            segment[0].inject_fault(0x2310)
            until(lambda: loop.error is not None)

    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS, velocity_limit=1.0)
        with pytest.raises(DriveError, match="0x2310"):
            run()


def test_a_fault_during_a_move_raises_the_error_of_the_loop(cell: Cell) -> None:
    move = cell.arm.move_to(3.0, velocity=0.5)
    cell.segment[1].inject_fault(0x2310)
    with pytest.raises(DriveError, match="0x2310"):
        cell.loop.wait(move)
    assert move.outcome == "failed"


def test_closing_during_a_move_ends_it(cell: Cell) -> None:
    move = cell.arm.move_to(3.0, velocity=0.5)
    until(lambda: cell.moved(0))
    cell.loop.close()
    with pytest.raises(MoveError, match="was moving when the loop ended"):
        cell.loop.wait(move)


# ---- laws and streams


@cat.law
def creep(target, memory, dt, parameters):
    memory[0] += parameters[0] * dt
    for i in range(len(target.position)):
        target.position[i] = memory[0]


def test_a_law_runs_while_the_program_changes_its_parameters(cell: Cell) -> None:
    run = cell.loop.start(creep, memory=[0.0], parameters=[0.5])
    until(lambda: cell.arm.actual.position[0] > 0.05)
    run.parameters = [-0.5]
    until(lambda: cell.arm.actual.position[0] < 0.0)
    run.stop()
    until(lambda: not run.running)
    with cell.loop.update():
        cell.arm.target.position[:] = 0.04
    until(lambda: cell.arm.actual.position[0] > 0.03)


def test_a_stream_is_written_ahead(cell: Cell) -> None:
    stream = cell.loop.stream()
    path = np.linspace(0.0, 0.1, 200)[:, None] * np.ones(2)
    stream.write(path)
    until(lambda: stream.taken == 200)
    stream.close()
    until(lambda: cell.arm.actual.position[0] > 0.09)
    cell.pass_cycles(100)
    assert cell.arm.enabled.all()


# ---- what is refused


def test_the_program_cannot_iterate_a_loop_in_the_background(cell: Cell) -> None:
    for iterate in (lambda: next(cell.loop), lambda: iter(cell.loop), cell.loop.wait_locked):
        with pytest.raises(RuntimeError, match="runs in the background"):
            iterate()
    cell.loop.run_in_background()  # again: the cell was run twice
    assert cell.loop.error is None


def test_calls_inside_an_update(cell: Cell) -> None:
    with cell.loop.update():
        with pytest.raises(RuntimeError, match=r"update\(\) was called inside"), cell.loop.update():
            raise AssertionError
        with pytest.raises(RuntimeError, match=r"wait\(\) was called inside"):
            cell.loop.wait(Condition(lambda: True))


def test_waiting_in_the_thread_that_iterates(cell: Cell) -> None:
    errors: list[str] = []

    def step(ended: threading.Event) -> None:
        try:
            cell.loop.wait(Condition(lambda: True))
        except RuntimeError as error:
            errors.append(str(error))

    background = cell.loop._background
    assert background is not None
    background._pace.keep = step  # type: ignore[method-assign]
    until(lambda: errors)
    assert "would deadlock" in errors[0]


def test_update_needs_the_background() -> None:
    cell = Cell("csp", 1)
    with pytest.raises(RuntimeError, match="run_in_background"):
        cell.loop.update()
    cell.loop.close()
    cell.main.close()


def test_an_inline_loop_cannot_run_in_the_background() -> None:
    cell = Cell("csp", 1, execution="inline")
    with pytest.raises(ValueError, match="threaded"):
        cell.loop.run_in_background()
    assert next(cell.loop).ok
    cell.loop.close()
    cell.main.close()


# ---- life


def test_open_and_close() -> None:
    cell = Cell("csp")
    with pytest.raises(RuntimeError, match="the loop is already open"):
        cell.loop.open()
    next(cell.loop)
    cell.run_in_background()
    cell.loop.close()
    cell.loop.close()
    assert cell.segment[0].state & 0x0F == 2
    cell.loop.open()
    cell.run_in_background()
    with cell.loop.update():
        cell.arm.target.position[0] += 0.05
    until(lambda: cell.moved(0))
    cell.loop.close()
    cell.main.close()


def test_a_second_loop_is_refused_and_the_first_continues(cell: Cell) -> None:
    with pytest.raises(RuntimeError, match=r"a loop runs.*close"):
        cat.Loop(cell.arm).open()
    cell.pass_cycles(5)
    assert cell.loop.error is None


def test_closing_the_main_device_closes_the_loop(cell: Cell) -> None:
    cell.main.close()
    assert cell.segment[0].state & 0x0F == 1
    with pytest.raises(RuntimeError, match="the loop is closed"), cell.loop.update():
        raise AssertionError


def test_interrupting_the_program_does_not_stop_the_loop(cell: Cell) -> None:
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    cell.pass_cycles(5)
    assert cell.arm.enabled.all()


def test_ctrl_c_while_closing_only_hurries(cell: Cell) -> None:
    class Interrupting:
        def report_end(self, error: BaseException) -> None: ...

        def close(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)

    mine = signal.signal(signal.SIGINT, signal.default_int_handler)  # as a notebook does
    cell.loop._sessions[0]._publisher = Interrupting()  # type: ignore[assignment]
    cell.loop.close()
    assert cell.segment[0].state & 0x0F == 2
    signal.signal(signal.SIGINT, mine)


def test_an_unreferenced_loop_is_stopped_with_a_warning() -> None:
    cell = Cell("csp", 1)
    cell.run_in_background()
    with pytest.warns(RuntimeWarning, match="was not left"):
        cell.forget()
    assert cell.segment[0].state & 0x0F == 2
    cell.main.close()


EXIT = """
import atexit
import catenary as cat
from catenary.realtime import VirtualClock
from catenary.types import SINT
from catenary.virtual import Segment, Servo

segment = Segment([Servo()])
atexit.register(lambda: print(segment[0].drive_state(), segment[0].state))
main = cat.MainDevice(segment)
main.open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
loop = cat.Loop(arm).open()
loop.run_in_background()
with loop.update():
    arm.target.position[:] += 0.05
{end}
"""


@pytest.mark.parametrize("end", ["", "raise SystemExit(0)"])
def test_the_end_of_the_program_closes_the_loop_silently(
    end: Literal["", "raise"],
) -> None:
    program = [sys.executable, "-W", "error", "-c", EXIT.format(end=end)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.stderr == ""
    assert done.stdout == "SWITCH ON DISABLED 2\n"
    assert done.returncode == 0


def test_sigterm_closes_the_loop() -> None:
    end = "import os, signal; os.kill(os.getpid(), signal.SIGTERM)"
    program = [sys.executable, "-W", "error", "-c", EXIT.format(end=end)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.stderr == ""
    assert done.stdout == "SWITCH ON DISABLED 2\n"
    assert done.returncode == 143


def test_a_forked_child_has_no_loop(cell: Cell) -> None:
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            cell.loop.update().__enter__()
        except (RuntimeError, CatenaryError) as error:
            os.write(write, str(error).encode())
        os._exit(0)
    os.waitpid(child, 0)
    assert b"parent process" in os.read(read, 1000)
    cell.pass_cycles(5)


# ---- after closing


def test_requests_after_closing_fail_and_values_stay() -> None:
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS, velocity_limit=1.0)
        with cat.Loop(arm) as loop:
            iteration = iter(loop)
            next(loop)
            last = arm.actual.position.copy()
        for request in (arm.enable, arm.disable, arm.quick_stop, arm.reset_faults):
            with pytest.raises(RuntimeError, match="the loop is closed"):
                request()
        with pytest.raises(RuntimeError, match="the loop is closed"):
            arm.switch("csp")
        for iterate in (lambda: next(loop), lambda: next(iteration), loop.stream):
            with pytest.raises(RuntimeError, match="the loop is closed"):
                iterate()
        assert arm.actual.position.tolist() == last.tolist()
        assert arm.enabled.shape == (1,)
        assert loop.timing.counters["cycles"] > 0


def test_a_callback_that_never_returns_is_named() -> None:
    cell = Cell("csp", 1)
    cell.run_in_background()
    background = cell.loop._background
    assert background is not None
    entered, release = threading.Event(), threading.Event()

    def stuck(ended: threading.Event) -> None:
        entered.set()
        release.wait(PATIENCE)

    background._pace.keep = stuck  # type: ignore[method-assign]
    assert entered.wait(PATIENCE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("catenary.loop.background.END_TIMEOUT", 0.1)
        with pytest.raises(LoopError, match="does not end"):
            cell.loop.close()
    assert cell.segment[0].state & 0x0F == 2
    release.set()
    cell.main.close()


# ---- several networks, and real time


def test_several_networks_in_the_background() -> None:
    clock = VirtualClock()
    mains = [cat.MainDevice(Segment([Servo()], clock=clock)) for _ in range(2)]
    for main in mains:
        main.open()
    arms = [
        cat.Drives(main.scan().drives, counts_per_turn=COUNTS, velocity_limit=10.0)
        for main in mains
    ]
    loop = cat.Loop(*arms).open()
    loop.run_in_background()
    with loop.update():
        for arm in arms:
            arm.target.position[:] = 0.05
    for arm in arms:
        loop.wait(Condition(lambda arm=arm: arm.actual.position[0] > 0.04))
    loop.close()
    for main in mains:
        main.close()


def test_csp_holds_while_the_program_keeps_the_interpreter() -> None:
    """In real time the native core judges: no Python thread can run meanwhile."""
    segment = Segment([Servo()], clock="monotonic")
    main = cat.MainDevice(segment)
    main.open()
    arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS, velocity_limit=10.0)
    stop = cat.StopPolicy(lost_limit=1_000_000)
    loop = cat.Loop(arm, period=2e-3, stop=stop, watchdog=0).open()
    loop.run_in_background()
    ctypes.PyDLL(None).usleep(300_000)  # does not release the interpreter
    with loop.update():
        arm.target.position[:] = arm.actual.position + 0.05
    goal = arm.target.position[0]
    loop.wait(Condition(lambda: arm.actual.position[0] > goal - 0.01))
    assert arm.stopped == (None,)
    loop.close()
    main.close()


def test_each_thread_that_closes_the_loop_returns_when_the_axes_stand() -> None:
    cell = Cell("csp", servos=1)
    cell.loop.run_in_background()
    cell.arm.move_to(20.0, velocity=2.0)
    until(lambda: cell.arm.actual.velocity[0] > 1.9)
    left: list[str] = []

    def close() -> None:
        cell.loop.close()
        left.append(cell.segment[0].drive_state())

    threads = [threading.Thread(target=close) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(left) == 4
    assert "OPERATION ENABLED" not in left
    cell.main.close()


def test_a_loop_that_cannot_run_in_the_background_keeps_its_late_limits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def failing() -> Iterator[None]:
        raise LoopError("no cycle completed within 1 s")
        yield

    cell = Cell("csp", servos=1)
    with monkeypatch.context() as patch:
        patch.setattr(cat.Loop, "_iterating", lambda self: failing())
        with pytest.raises(LoopError, match="no cycle completed"):
            cell.loop.run_in_background()
    assert not cell.loop._opened.engine.background
    with pytest.raises(RuntimeError, match="needs run_in_background"):
        cell.loop.update()
    cell.loop.close()
    cell.main.close()


def test_an_exit_in_the_thread_stops_the_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Cell("csp", servos=1)

    def leave(self: Session, flags: int) -> None:
        raise SystemExit(1)

    monkeypatch.setattr(Session, "judge", leave)
    cell.loop.run_in_background()
    cell.segment[0].inject_fault(0x2310)
    until(lambda: cell.loop.error is not None)
    with pytest.raises(LoopError, match=r"was ended by SystemExit\(1\)"):
        cell.loop.close()
    assert cell.segment[0].drive_state() != "OPERATION ENABLED"
    cell.main.close()
