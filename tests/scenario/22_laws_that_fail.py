"""A compiled law fails while the drives move.
The cycle thread stops the drives, the bus continues, and the error gives the cause.
"""

import math
from collections.abc import Callable

import pytest

import catenary as cat
from catenary.errors import LawError
from tests.scenario.cell import OP, Cell

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
WRONG_FROM = 0.3  # [s]


def divides(actual, target, memory, time):
    for i in range(actual.n):
        target.velocity[i] = 1.0 / (0.5 if time < WRONG_FROM else time - time)


def indexes(actual, target, memory, time):
    for i in range(actual.n + (0 if time < WRONG_FROM else 5)):
        target.velocity[i] = 2.0


def hangs(actual, target, memory, time):
    for i in range(actual.n):
        target.velocity[i] = 2.0
    while time > WRONG_FROM:
        memory[0] += 1.0


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize(
    ("law", "said"),
    [(divides, "NaN or infinity"), (indexes, "IndexError"), (hangs, "did not return")],
)
def test_the_drives_stop_and_the_bus_continues(
    cell: Cell, law: Callable, said: str, run: str
) -> None:
    arm = cell.drives(mode="csv")
    with cat.Loop(arm, execution=run) as loop:
        turning = loop.start(law, memory=[0.0])
        with pytest.raises(LawError, match=said):
            for cycle in loop:
                if cycle.time > 0.25:
                    assert all(servo.velocity_rad_s > 1.0 for servo in cell.servos)
        assert not turning.running
        for cycle in loop:
            arm.target.velocity[:] = 2.0  # must not be followed
            if cycle.time > 1.5:
                break
        assert all(abs(servo.velocity_rad_s) < 1e-3 for servo in cell.servos)
        assert "OPERATION ENABLED" not in cell.drive_states
        assert cell.states == [OP] * 4
        assert loop.timing.counters["lost"] == 0
    cell.assert_safe()


def test_ctrl_c_while_a_law_runs_leaves_safely(cell: Cell) -> None:
    @cat.law
    def forever(actual, target, memory, time):
        for i in range(actual.n):
            target.velocity[i] = 2.0 * math.sin(time)

    arm = cell.drives(mode="csv")
    with pytest.raises(KeyboardInterrupt), cat.Loop(arm) as loop:
        loop.start(forever)
        for cycle in loop:
            if cycle.time > 0.3:
                raise KeyboardInterrupt
    cell.assert_safe()
