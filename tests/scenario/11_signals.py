"""Ctrl-C or SIGTERM arrives at any time: while the loop is entered, runs or is left.
At every line of code, no device stays in OP and no drive stays enabled.
A signal while leaving shortens the process, but does not interrupt it.
"""

import signal
import subprocess
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

import catenary as cat
from tests.scenario.cell import OP, PRE_OP, Cell, cell_of

SCRIPT = """
import math
import catenary as cat
from catenary.virtual import demo_segment

class Arm(cat.Drives):
    def bind(self, views):  # in the middle of entering
        print("entering", flush=True)
        super().bind(views)


segment = demo_segment(clock="monotonic")
with cat.MainDevice(segment) as main:
    arm = Arm(main.scan().drives, counts_per_turn=2**20)
    try:
        with cat.Loop(arm, priority=None, watchdog=5.0,
            stop=cat.StopPolicy(lost_limit=1000, late_limit=0)) as loop:
            print("running", flush=True)
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + math.sin(5 * cycle.time)
    finally:
        states = [device.state for device in segment]
        drives = [segment[k].drive_state() for k in (2, 3, 4)]
        print("left", states, drives, flush=True)
"""


class Tripwire:
    """Tracer that sends a signal to this process at the n-th executed line of the loop's code."""

    def __init__(self, line: int, number: signal.Signals) -> None:
        self.left = line
        self._number = number

    def __enter__(self) -> None:
        sys.settrace(self._calls)

    def __exit__(self, *exc_info: object) -> None:
        sys.settrace(None)

    def _calls(self, frame: FrameType, event: str, argument: Any) -> Callable[..., Any] | None:
        return self._lines if "catenary/loop" in frame.f_code.co_filename else None

    def _lines(self, frame: FrameType, event: str, argument: Any) -> Callable[..., Any]:
        if event == "line":
            self.left -= 1
            # Before and after the loop handles SIGTERM, the signal ends the process.
            if self.left == 0 and signal.getsignal(self._number) is not signal.SIG_DFL:
                signal.raise_signal(self._number)
        return self._lines


def enter_run_leave(cell: Cell, cycles: int = 5) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 0.1 * cycle.time
            if cycle.number == cycles:
                break


def lines_of_a_life() -> int:
    """Return the number of executed lines of the loop's code for one run."""
    wire = Tripwire(1_000_000, signal.SIGINT)
    with cell_of() as cell, wire:
        enter_run_leave(cell)
    return 1_000_000 - wire.left


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_at_any_line_leaves_no_device_in_op(number: signal.Signals) -> None:
    total = lines_of_a_life()
    assert total > 300
    ended = {KeyboardInterrupt: 0, SystemExit: 0, None: 0}
    for line in range(2, total, total // 30):
        with cell_of() as cell:
            kind = None
            before = signal.getsignal(number)
            try:
                with Tripwire(line, number):
                    enter_run_leave(cell)
            except (KeyboardInterrupt, SystemExit) as end:
                kind = type(end)
            ended[kind] += 1
            cell.assert_safe()
            assert all(state <= PRE_OP for state in cell.states), (line, cell.states)
            assert signal.getsignal(number) is before
    assert ended[KeyboardInterrupt if number == signal.SIGINT else SystemExit] > 5
    assert ended[None] > 0  # while leaving: shortened, not interrupted


def first_words(child: subprocess.Popen[str], word: str) -> None:
    assert child.stdout is not None
    assert child.stdout.readline().strip() == word


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moment", ["entering", "running"])
def test_a_real_process_brings_its_devices_down(number: signal.Signals, moment: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        first_words(child, "entering")
        if moment == "running":
            first_words(child, "running")
        child.send_signal(number)
        output, errors = child.communicate(timeout=60)
    assert "left [2, 2, 2, 2, 2, 2]" in output, (output, errors)
    assert "OPERATION ENABLED" not in output
    if number == signal.SIGTERM:
        assert child.returncode == 143
    else:
        assert child.returncode == -signal.SIGINT
        assert "KeyboardInterrupt" in errors


def test_a_second_signal_shortens_the_wait_for_standstill(cell: Cell) -> None:
    arm = cell.drives()
    start = 0
    with cat.Loop(arm, stop=cat.StopPolicy(stop_deadline=60.0)) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 20.0 * cycle.time
            if cycle.time > 0.5:
                break
        cell.servos[0].apply_load(50.0)  # it cannot stop
        start = cell.link.now()
        loop._guard.hurry = True  # what the handler does, see tests/loop/test_signals.py
    assert cell.link.now() - start < 5e9
    assert OP not in cell.states
