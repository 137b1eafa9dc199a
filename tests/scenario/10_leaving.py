"""The block of the loop is left at full speed: at its end, by an exception or by Ctrl-C.
The drives brake with a quick stop while the cycle continues. Then the states go down.
"""

from collections.abc import Iterator

import pytest

import catenary as cat
from tests.scenario.cell import KINDS, PRE_OP, Cell, cell_with

FAST = 20.0  # [rad/s]; the quick stop ramp of the servos is 1000 rad/s²


@pytest.fixture(params=KINDS)
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    """Yield a cell with drives of each kind."""
    with cell_with(request.param) as cell:
        yield cell


class Stumble(Exception):
    pass


def spin(cell: Cell, arm: cat.Drives, run: str, end: BaseException | None) -> None:
    with cat.Loop(arm, execution=run) as loop:  # type: ignore[arg-type]
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + FAST * cycle.time
            if cycle.time > 0.5:
                assert all(servo.velocity_rad_s > 0.9 * FAST for servo in cell.servos)
                if end is not None:
                    raise end
                break


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize("end", [None, Stumble("body"), KeyboardInterrupt(), SystemExit(3)])
def test_all_drives_stop_and_all_states_go_down(
    cell: Cell, run: str, end: BaseException | None
) -> None:
    arm = cell.drives()
    if end is None:
        spin(cell, arm, run, end)
    else:
        with pytest.raises(type(end)) as caught:
            spin(cell, arm, run, end)
        assert caught.value is end
    cell.assert_safe()
    assert cell.states == [PRE_OP] * 4
    # 1000 rad/s² take 20 rad/s away in 0.2 rad; coasting would take seconds.
    for servo, last in zip(cell.servos, arm.actual.position, strict=True):
        assert servo.position_rad - last < 0.5


@pytest.mark.parametrize(("mode", "target"), [("csv", "velocity"), ("cst", "torque")])
def test_leaving_stops_the_drives_in_every_mode(cell: Cell, mode: str, target: str) -> None:
    arm = cell.drives(mode=mode, velocity_limit=FAST)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.velocity[:] = FAST
            arm.target.torque[:] = 0.2
            if cycle.time > 0.5:
                break
    cell.assert_safe()
    assert cell.states == [PRE_OP] * 4


def test_leaving_does_not_wait_forever_for_a_drive_that_cannot_brake(cell: Cell) -> None:
    arm = cell.drives()
    start = 0
    with cat.Loop(arm, stop=cat.StopPolicy(stop_deadline=0.2)) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + FAST * cycle.time
            if cycle.time > 0.5:
                cell.servos[0].apply_load(50.0)  # more than the motor can hold
                start = cell.link.now()
                break
    assert cell.link.now() - start < 2e9
    assert cell.states == [PRE_OP] * 4
    assert "OPERATION ENABLED" not in cell.drive_states


def test_a_loop_can_be_entered_again(cell: Cell) -> None:
    arm = cell.drives()
    loop = cat.Loop(arm)
    for _ in range(3):
        with loop:
            for cycle in loop:
                assert cycle.time < 0.1
                if cycle.number == 20:
                    break
        cell.assert_safe()


def test_figures_and_log_stay_readable_after_the_loop(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 50:
                break
    assert loop.timing["period"]["mean"] == pytest.approx(1e-3)
    assert len(loop.log) >= 50
    assert arm.actual.position.shape == (2,)
