"""Decisions of the safety task: cause, braking, stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exchange import STATE, Cause, Mode, Verdict
from safety import Rules, Safety

DT = 1e-3
RULES = Rules(tilt=0.4, silence=0.01, lost=0.005, brake=0.5)


@pytest.fixture
def state() -> Any:
    state = np.zeros((), STATE)
    state["mode"], state["imu_valid"], state["drives_valid"] = Mode.BALANCE, 1, 1
    return state


@pytest.fixture
def safety() -> Safety:
    return Safety(RULES)


def test_without_a_cause_the_robot_may_move(safety: Safety, state: Any) -> None:
    for number in range(100):
        assert safety.step(number * DT, DT, state, 0.39, {Cause.SILENT_LOOP: 0.01}) == Verdict.GO
    assert safety.cause == Cause.NONE


def test_a_fall_brakes_and_then_stops_for_ever(safety: Safety, state: Any) -> None:
    assert safety.step(1.0, DT, state, 0.41, {}) == Verdict.DAMP
    assert safety.cause == Cause.FALLEN
    assert safety.step(1.49, DT, state, 0.0, {}) == Verdict.DAMP
    assert safety.step(1.5, DT, state, 0.0, {}) == Verdict.STOP
    assert safety.step(9.0, DT, state, 0.0, {}) == Verdict.STOP


def test_a_tilt_that_is_not_a_number_counts_as_a_fall(safety: Safety, state: Any) -> None:
    assert safety.step(0.0, DT, state, float("nan"), {}) == Verdict.DAMP


@pytest.mark.parametrize("name", ["drives_valid", "imu_valid"])
def test_a_loss_counts_only_if_it_lasts(safety: Safety, state: Any, name: str) -> None:
    now = 0.0
    for there in [0] * 5 + [1] + [0] * 5:
        state[name] = there
        assert safety.step(now := now + DT, DT, state, 0.0, {}) == Verdict.GO
    assert safety.step(now + DT, DT, state, 0.0, {}) == Verdict.DAMP
    assert safety.cause == (Cause.LOST_DRIVE if name == "drives_valid" else Cause.LOST_IMU)


@pytest.mark.parametrize("cause", [Cause.SILENT_ESTIMATOR, Cause.SILENT_BALANCE])
def test_a_silent_task_is_named(safety: Safety, state: Any, cause: Cause) -> None:
    assert safety.step(0.0, DT, state, 0.0, {cause: 0.0101}) == Verdict.DAMP
    assert safety.cause == cause


def test_a_robot_in_its_gantry_may_hang_tilted(safety: Safety, state: Any) -> None:
    state["held"] = 1
    assert safety.step(0.0, DT, state, 1.0, {}) == Verdict.GO


def test_in_the_damping_mode_nothing_is_decided(safety: Safety, state: Any) -> None:
    state["mode"], state["imu_valid"], state["drives_valid"] = Mode.DAMPING, 0, 0
    for number in range(100):
        ages = {Cause.SILENT_BALANCE: 1.0}
        assert safety.step(number * DT, DT, state, 1.0, ages) == Verdict.GO
