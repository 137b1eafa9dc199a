"""Programs that move drives: CSP and PP moves, homing, torque limit, a fault."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from catenary.drive import Drives
from catenary.drive.move import Move
from catenary.virtual import Segment, Servo
from catenary.virtual.faults import drive_fault

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]


def test_pp_move(run_program: RunProgram) -> None:
    servos = [Servo(), Servo(), Servo()]
    names = run_program("pp_move", Segment(servos))
    move = names["move"]
    assert isinstance(move, Move)
    assert move.outcome == "reached"
    assert [servo.position_rad for servo in servos] == pytest.approx([0.5, -0.2, 1.1], abs=2e-3)


def test_profile_move(run_program: RunProgram) -> None:
    names = run_program("profile_move", Segment([Servo(), Servo(), Servo()]))
    arm, move, there = names["arm"], names["move"], names["there"]
    assert isinstance(arm, Drives)
    assert isinstance(move, Move)
    assert there == pytest.approx(np.array([0.5, -0.2, 1.1]), abs=1e-3)
    assert move.outcome == "stopped"
    assert 0.35 < arm.actual.position[0] < 0.4


def test_csv_with_a_torque_limit(run_program: RunProgram) -> None:
    servo = Servo(inertia=0.1)  # 0.5 N·m accelerate it by 5 rad/s²
    names = run_program("csv_torque_limit", Segment([servo]))
    assert names["torque"] == pytest.approx([0.5], abs=0.01)
    assert names["velocity"] == pytest.approx([9.5], abs=0.6)


def test_homing(run_program: RunProgram) -> None:
    servos = [Servo(), Servo()]
    segment = Segment(servos)
    names = run_program("homing", segment)
    arm = names["arm"]
    assert isinstance(arm, Drives)
    assert arm.actual.position == pytest.approx([0.1, 0.1], abs=1e-3)


def test_fault_and_continue(run_program: RunProgram, capsys: pytest.CaptureFixture[str]) -> None:
    fault = drive_fault(1, at=0.5, for_=2e-3)  # while the axes move; its cause ends after 2 ms
    names = run_program("fault_and_continue", Segment([Servo(), Servo()], faults=[fault]))
    arm = names["arm"]
    assert isinstance(arm, Drives)
    assert arm.actual.position == pytest.approx([1.0, 1.0], abs=1e-3)
    assert "the drive is in fault" in capsys.readouterr().out
