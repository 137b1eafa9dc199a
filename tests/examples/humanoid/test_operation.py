"""Modes and presets of the robot: which requests are accepted, and when."""

from __future__ import annotations

import pytest

pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")

from exchange import Cause, Mode, Verdict
from operation import Operation


@pytest.fixture
def operation() -> Operation:
    operation = Operation()
    operation.ready = True
    return operation


def test_the_robot_stands_before_it_balances(operation: Operation) -> None:
    assert "gantry" in str(operation.request("mode", "balance"))
    assert operation.request("mode", "stand") is None
    operation.held = False
    assert operation.request("mode", "balance") is None
    assert operation.mode == Mode.BALANCE


def test_without_enabled_drives_only_damping_is_accepted() -> None:
    operation = Operation()
    assert "not enabled" in str(operation.request("mode", "stand"))
    assert operation.request("mode", "damping") is None


def test_after_a_decision_of_the_safety_task_the_robot_stays_in_damping(
    operation: Operation,
) -> None:
    operation.request("mode", "stand")
    operation.decide(Verdict.DAMP, Cause.FALLEN)
    assert operation.mode == Mode.DAMPING
    assert "fallen" in str(operation.request("mode", "stand"))
    operation.decide(Verdict.GO, Cause.NONE)
    assert operation.verdict == Verdict.DAMP
    operation.decide(Verdict.STOP, Cause.FALLEN)
    assert [event.text for event in operation.events][-2:] == [
        "mode stand refused: safety: fallen; start the program again",
        "fallen: stop",
    ]


def test_presets_need_compliant_joints(operation: Operation) -> None:
    assert "damping" in str(operation.request("preset", "wave"))
    operation.request("mode", "stand")
    assert operation.request("preset", "wave") is None
    assert operation.request("preset", "home") is None
    assert operation.preset == (2, 0)


class Request:
    """Request of an operator, and its answer."""

    def __init__(self, kind: str, name: str, *, open_: bool = True) -> None:
        self.kind, self.name, self.answer = kind, name, ""
        self._open = open_

    def accept(self) -> bool:
        self.answer = "accepted" if self._open else ""
        return self._open

    def refuse(self, reason: str) -> None:
        self.answer = reason


def test_requests_of_an_operator_are_answered(operation: Operation) -> None:
    refused, accepted = Request("mode", "balance"), Request("mode", "stand")
    operation.serve(refused)
    operation.serve(accepted)
    assert "gantry" in refused.answer
    assert accepted.answer == "accepted"
    assert operation.mode == Mode.STAND


def test_a_withdrawn_request_has_no_effect(operation: Operation) -> None:
    operation.serve(Request("mode", "stand", open_=False))
    assert operation.mode == Mode.DAMPING
