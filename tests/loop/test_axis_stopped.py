"""Axes that the core stopped: new stops, errors and their messages."""

import numpy as np
import pytest

import catenary as cat
from catenary import events
from catenary.core import (
    AXIS_MODE_REFUSED,
    CYCLE_DRY,
    CYCLE_UNCOMMITTED,
    RECORD_FIELDS,
    REQUEST_DISABLED,
    REQUEST_ENABLED,
)
from catenary.errors import DriveError
from catenary.loop.stop_error import stopped_error
from catenary.loop.watches.axis import AxisWatch, StoppedAxis
from catenary.plan.cycle import AxisPlan, CyclePlan, Number, NumberKind
from catenary.plan.request import RequestTables, Views
from catenary.plan.stop_reason import UNASKED, StopReason
from tests.drive.fakes import views_of
from tests.loop_options import grouped

WORD = Number(0, 16, NumberKind.UNSIGNED)


def axes(count: int) -> tuple[AxisPlan, ...]:
    return tuple(AxisPlan(f"{k} Servo", k, 0, 0, 8, WORD, WORD) for k in range(count))


def watched(count: int = 2) -> tuple[AxisWatch, Views]:
    views = views_of(RequestTables(axes(count)))
    views.requested_state[:] = REQUEST_ENABLED
    return AxisWatch(views, axes(count)), views


def stop(views: Views, axis: int, reason: StopReason, cycle: int) -> None:
    views.stop_reason[axis], views.stop_cycle[axis] = reason, cycle


def test_a_stop_is_new_once() -> None:
    watch, views = watched()
    assert watch.new_stops() == []
    stop(views, 1, StopReason.UNDERRUN, 7)
    assert watch.new_stops() == [
        StoppedAxis(1, "1 Servo", 1, 8, StopReason.UNDERRUN, 7, requested=False)
    ]
    assert watch.new_stops() == []


def test_the_same_reason_in_a_later_cycle_is_new() -> None:
    watch, views = watched()
    stop(views, 0, StopReason.REFUSED, 7)
    watch.new_stops()
    stop(views, 0, StopReason.REFUSED, 70)
    assert [each.cycle for each in watch.new_stops()] == [70]


def test_a_new_request_is_not_a_stop() -> None:
    watch, views = watched()
    stop(views, 0, StopReason.REFUSED, 7)
    watch.new_stops()
    stop(views, 0, StopReason.NONE, 7)
    assert watch.new_stops() == []


def test_a_stop_that_the_application_requested_is_marked() -> None:
    watch, views = watched()
    views.requested_state[0] = REQUEST_DISABLED
    for axis in range(2):
        stop(views, axis, StopReason.STOP_REQUEST, 7)
    assert [each.requested for each in watch.new_stops()] == [True, False]


def test_a_refused_mode_is_new_once_per_occurrence() -> None:
    watch, views = watched()
    views.mode_target[1] = 10
    views.axis_flags[1] = AXIS_MODE_REFUSED
    assert [(r.axis, r.mode) for r in watch.new_refusals(explained=False)] == [(1, 10)]
    assert watch.new_refusals(explained=True) == []  # a stop of another axis, the bit is still set
    assert [r.axis for r in watch.new_refusals(explained=False)] == [1]  # asked again meanwhile
    views.axis_flags[1] = 0
    assert watch.new_refusals(explained=True) == []
    views.axis_flags[1] = AXIS_MODE_REFUSED
    assert [r.axis for r in watch.new_refusals(explained=True)] == [1]


def error_of(reason: StopReason, mode: int = 8, flags: tuple[int, ...] = ()) -> DriveError:
    log = np.zeros(len(flags), np.dtype(RECORD_FIELDS))
    log["number"], log["flags"] = np.arange(len(flags)), flags
    plan = CyclePlan(1_000_000, "threaded", "wait", 0, 0, 0, (), (), 1)
    stopped = StoppedAxis(0, "0 Servo", 0, mode, reason, len(flags), requested=False)
    return stopped_error([stopped], plan, log)


@pytest.mark.parametrize("reason", sorted(UNASKED))
def test_the_error_names_axis_reason_and_cycle_and_what_to_do(reason: StopReason) -> None:
    error = error_of(reason)
    assert error.message.startswith("0 Servo was stopped in cycle 0: ")
    assert reason.text in error.message
    assert 'StopPolicy(on_axis_stopped="event")' in error.hint
    assert not error.hint.startswith(";")


def test_the_error_of_an_underrun_says_what_was_late() -> None:
    late = error_of(StopReason.UNDERRUN, 10, (1, CYCLE_UNCOMMITTED, CYCLE_UNCOMMITTED)).message
    assert "(10 ms in CST), the program wrote no targets for 2 cycles" in late
    empty = error_of(StopReason.UNDERRUN, 8, (CYCLE_DRY,) * 3).message
    assert "(50 ms in CSP), the stream was empty for 3 cycles" in empty
    assert "(50 ms in CSV), the program was late" in error_of(StopReason.UNDERRUN, 9).message
    assert "(20 ms)" in error_of(StopReason.HANDOVER, 10).message


def two_arms(main: cat.MainDevice, **options: object) -> tuple[cat.Drives, cat.Drives]:
    subs = main.scan()
    given = {"counts_per_turn": 2**20, "velocity_limit": 10.0}
    return (
        cat.Drives(subs[:1], **given),  # type: ignore[arg-type]
        cat.Drives(subs[1:], **given, required=False),  # type: ignore[arg-type]
    )


def test_only_a_required_axis_raises() -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])) as main:
        arm, tool = two_arms(main)
        with cat.Loop(arm, tool) as loop:
            for cycle in loop:
                tool.target.position[:] = np.nan
                if cycle.number == 200:
                    break
            assert arm.enabled.all()
            assert tool.stopped == (StopReason.REFUSED,)
            [event] = [e for e in main.events if isinstance(e, events.AxisStopped)]
            assert (event.axis, event.sub, event.reason) == (
                "1 Catenary virtual servo",
                main.subs[1],
                StopReason.REFUSED,
            )
            assert 40 < event.cycle < 70
            tool.target.position[:] = tool.actual.position
            tool.enable()
            assert tool.stopped == (StopReason.REFUSED,)  # until the request is taken over
            for cycle in loop:
                tool.target.position[:] = tool.actual.position
                if cycle.number == 300:
                    break
            assert tool.stopped == (None,)
            assert tool.enabled.all()


def test_a_requested_stop_puts_no_event() -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=10.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 20:
                    arm.quick_stop(0)
                if cycle.number == 40:
                    arm.disable(1)
                if cycle.number == 100:
                    break
        assert not [e for e in main.events if isinstance(e, events.AxisStopped)]


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (
            {"on_axis_stopped": "ignore"},
            "on_axis_stopped='ignore': must be one of \"raise\"",
        ),
        ({"late_limit": -1.0}, "late_limit=-1"),
        ({"late_limit": float("nan")}, "late_limit=nan"),
    ],
)
def test_impossible_options(options: dict[str, object], match: str) -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=1, velocity_limit=10.0)
        with pytest.raises(ValueError, match=match):
            cat.Loop(arm, **grouped(options))  # type: ignore[arg-type]


def test_the_times_reach_the_plan() -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
        subs = main.scan()
        csp = cat.Drives(subs.drives, counts_per_turn=1000, velocity_limit=10.0)
        cst = cat.Drives(subs.drives, mode="cst", counts_per_turn=1000, velocity_limit=10.0)
        for late, expected in ((None, (50, 50, 10)), (0.03, (30, 30, 30)), (0, (0, 0, 0))):
            with cat.Loop(csp, stop=cat.StopPolicy(late_limit=late, handover=0.007)) as loop:
                cycle = loop.plan.cycle
            found = (
                cycle.late_limit_position_ns,
                cycle.late_limit_velocity_ns,
                cycle.late_limit_torque_ns,
            )
            assert found == tuple(1_000_000 * ms for ms in expected)
            assert cycle.handover_ns == 7_000_000
        with (
            pytest.raises(ValueError, match="late_limit=0 is refused"),
            cat.Loop(cst, stop=cat.StopPolicy(late_limit=0)),
        ):
            pass
        with cat.Loop(cst, stop=cat.StopPolicy(late_limit=0.02)) as loop:
            assert "CST 20 ms" in str(loop.plan)
