"""Conversion of bad cycles into events and one exception: order of causes, policies."""

from types import SimpleNamespace
from typing import Any

import pytest

from catenary.core import (
    CYCLE_CLOCKS,
    CYCLE_DROPPED,
    CYCLE_NONE,
    CYCLE_OK,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    REQUEST_ENABLED,
)
from catenary.errors import DriveError, LinkError, LoopError, StateError, WorkingCounterError
from catenary.loop.cycle_errors import Evidence
from catenary.loop.fault_report import FaultReport
from catenary.loop.options import StopPolicy
from catenary.loop.session import Session
from catenary.plan.cycle import AxisPlan, CyclePlan, Number, NumberKind, SyncUnit
from catenary.plan.request import RequestTables
from catenary.plan.stop_reason import StopReason
from catenary.procedure.al_status_poll import Answer
from catenary.procedure.station import Station
from catenary.wire.al import AlState
from tests.drive.fakes import views_of

WORD = Number(0, 16, NumberKind.UNSIGNED)
AXES = (AxisPlan("0 Servo", 0, 0, 0, 8, WORD, WORD),)
PLAN = CyclePlan(
    1_000_000, "threaded", "wait", 0, 0, 0, (), (SyncUnit("device 0", (0,)),), 1, axes=AXES
)
FAULT = 0x0008  # statusword


class Rig:
    """A FaultReport over one axis, with simulated devices."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **policy: Any) -> None:
        monkeypatch.setattr("catenary.loop.fault_report.read_log", lambda engine, plan: None)
        self.events: list[object] = []
        self.al_status = AlState.OP
        self.views = views_of(RequestTables(AXES))
        self.views.requested_state[:] = REQUEST_ENABLED
        engine: Any = SimpleNamespace(
            al_status=AlState.OP,
            lost_in_row=3,
            buffers={"unit_valid": memoryview(b"\x00")},
            now=lambda: 2_000_000_000,
            quick_stop_all=lambda: None,
        )
        self.engine = engine
        exchange: Any = SimpleNamespace(
            watch=SimpleNamespace(requires=lambda position: True, excuses=False),
            query_silence=lambda suspects: self.evidence(),
            query_states=self.evidence,
            error_code=lambda axis: 0x2310,
        )
        main: Any = SimpleNamespace(events=SimpleNamespace(put=self.events.append), subs=[object()])
        laws: Any = SimpleNamespace(failure=lambda log: None)
        self.report = FaultReport(
            main, PLAN, engine, self.views, exchange, laws, StopPolicy(**policy)
        )

    def evidence(self) -> Evidence:
        return Evidence([Answer(Station(0, 0x1000, "Servo"), int(self.al_status))])

    def leave_op(self) -> None:
        self.al_status = self.engine.al_status = AlState.SAFE_OP

    def stop(self, reason: StopReason) -> None:
        self.views.stop_reason[0], self.views.stop_cycle[0] = reason, 7


def test_a_good_cycle_has_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Rig(monkeypatch).report.error(CYCLE_OK) is None


@pytest.mark.parametrize("flag", [CYCLE_STOPPED, CYCLE_NONE])
def test_the_end_of_the_cycle_precedes_all_other_causes(
    monkeypatch: pytest.MonkeyPatch, flag: int
) -> None:
    rig = Rig(monkeypatch)
    assert type(rig.report.error(flag | CYCLE_WORKING_COUNTER)) is LoopError


def test_missing_answers_precede_a_device_out_of_op(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch)
    rig.leave_op()
    assert isinstance(rig.report.error(CYCLE_WORKING_COUNTER), WorkingCounterError)


def test_a_device_out_of_op_precedes_the_fault_of_its_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(monkeypatch)
    rig.leave_op()
    rig.views.statusword[0] = FAULT
    assert isinstance(rig.report.error(CYCLE_OK), StateError)


def test_a_fault_is_not_an_error_while_the_drives_are_enabled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig(monkeypatch)
    rig.views.statusword[0] = FAULT
    assert rig.report.error(CYCLE_OK, enabling=True) is None
    assert isinstance(rig.report.error(CYCLE_OK), DriveError)


def test_a_fault_is_not_an_error_with_raise_faults_off(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, raise_faults=False)
    rig.views.statusword[0] = FAULT
    assert rig.report.error(CYCLE_OK) is None


@pytest.mark.parametrize("reaction", ["raise", "event"])
def test_a_stop_is_an_event_and_by_default_an_error(
    monkeypatch: pytest.MonkeyPatch, reaction: str
) -> None:
    rig = Rig(monkeypatch, on_axis_stopped=reaction)
    rig.stop(StopReason.REFUSED)
    error = rig.report.error(CYCLE_DROPPED)
    assert isinstance(error, DriveError) == (reaction == "raise")
    [event] = rig.events
    assert event.time == 2.0  # type: ignore[attr-defined]


def test_the_event_of_the_clocks_precedes_the_queries_of_a_fault() -> None:
    calls: list[str] = []

    def error(flags: int, *, enabling: bool) -> None:
        calls.append("queries")
        raise LinkError("the link failed during the queries")

    session: Any = SimpleNamespace(
        views=SimpleNamespace(movers=[]),
        faults=SimpleNamespace(error=error),
        announce_clocks=lambda: calls.append("clocks"),
    )
    with pytest.raises(LinkError):
        Session.judge(session, CYCLE_CLOCKS | CYCLE_WORKING_COUNTER)
    assert calls == ["clocks", "queries"]
