"""The body of the loop computes too long. The native thread keeps exchanging process data.
A position holds; velocity and torque ramp to zero. After the late limit, the drives stop quickly.
Late targets then move nothing until the application requests it.
"""

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary import events
from catenary.errors import DriveError
from catenary.plan.stop_reason import StopReason
from catenary.wire.cia402 import AxisState
from tests.scenario.cell import KINDS, OP, Cell, cell_with


@pytest.fixture(params=KINDS)
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    """Yield a cell with drives of each kind."""
    with cell_with(request.param) as cell:
        yield cell


def test_a_position_holds_while_python_is_a_little_late(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        late = 0
        for cycle in loop:
            arm.target.position[:] = home + 0.1
            late += cycle.late
            if cycle.number >= 500:
                break
            if 200 <= cycle.number < 400:
                cycle.spend(30e-3)
        assert late > 0
        assert arm.enabled.all()
        assert loop.timing.counters["uncommitted"] > 0
        assert loop.timing.counters["lost"] == 0
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(home + 0.1, abs=1e-3)
    cell.assert_safe()


def test_after_the_late_limit_the_axes_stop_and_stay_stopped(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            if cycle.number < 100:
                arm.target.position[:] = home + 2.0 * cycle.time
            elif cycle.number == 100:
                cycle.spend(0.5)
                assert "OPERATION ENABLED" not in cell.drive_states
                stopped = [servo.position_rad for servo in cell.servos]
            else:
                arm.target.position[:] = home + 1.0  # must not be followed
            if cycle.time > 1.5:
                break
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(stopped, abs=1e-3)
        assert not arm.enabled.any()
        assert arm.stopped == (StopReason.UNDERRUN,) * 2
        assert cell.states == [OP] * 4  # the cycle never stopped
    stops = [e for e in cell.main.events if isinstance(e, events.AxisStopped)]
    assert [(e.axis, e.reason) for e in stops] == [(n, StopReason.UNDERRUN) for n in arm.names]
    cell.assert_safe()


def test_the_iteration_names_the_stopped_axes_and_the_reason(cell: Cell) -> None:
    arm = cell.drives()
    with pytest.raises(DriveError, match=r"in cycle .*late_limit") as caught, cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 100:
                cycle.spend(0.5)
            assert cycle.number < 110
    assert all(name in str(caught.value) for name in arm.names)
    assert "50 ms in CSP" in caught.value.message
    assert "wrote no targets for" in caught.value.message
    assert "StopPolicy(late_limit=...)" in caught.value.hint
    cell.assert_safe()


def test_enabling_again_starts_at_the_actual_position(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 20:
                cycle.spend(0.5)
                arm.enable()
                stopped = [servo.position_rad for servo in cell.servos]
            if cycle.time > 1.0:
                break
        assert arm.state == (AxisState.OPERATION_ENABLED,) * 2
        assert arm.enabled.all()
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(stopped, abs=1e-3)


@pytest.mark.parametrize("mode", ["csv", "cst"])
def test_velocity_and_torque_ramp_to_zero_and_stop(cell: Cell, mode: str) -> None:
    arm = cell.drives(mode=mode)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.velocity[:] = 5.0
            arm.target.torque[:] = 0.03
            if cycle.number == 400:
                assert all(servo.velocity_rad_s > 1.0 for servo in cell.servos)
                cycle.spend(8e-3)  # less than the limit of 10 ms
                assert set(cell.drive_states) == {"OPERATION ENABLED"}
            if cycle.number == 500:
                cycle.spend(0.1)
                break
        assert all(abs(servo.velocity_rad_s) < 0.05 for servo in cell.servos)
        assert "OPERATION ENABLED" not in cell.drive_states
    cell.assert_safe()


def test_the_late_limit_is_disabled_only_on_request(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(late_limit=0)) as loop:
        for cycle in loop:
            if cycle.number == 20:
                cycle.spend(2.0)
                break
        assert set(cell.drive_states) == {"OPERATION ENABLED"}
    cell.assert_safe()


def test_a_late_inline_body_stops_the_bus_and_the_watchdog_expires(cell: Cell) -> None:
    arm = cell.drives()
    with (
        pytest.raises(cat.CatenaryError, match="SAFE-OP"),
        cat.Loop(arm, execution="inline") as loop,
    ):
        for cycle in loop:
            if cycle.number == 20:
                cycle.spend(0.5)
            assert cycle.number < 50
    cell.assert_safe()
