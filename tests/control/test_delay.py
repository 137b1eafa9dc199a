"""Delay line: shifted values, several delays, restart."""

import numpy as np
import pytest

from catenary import control


def test_each_axis_is_delayed_by_its_own_steps() -> None:
    block = control.Delay(3, [0, 1, 4])
    given = np.random.default_rng(1).normal(size=(20, 3))
    memory, parameters = block.memory, block.parameters
    seen = np.array([control.every(control.delay, (memory, parameters), row) for row in given])
    for i, steps in enumerate((0, 1, 4)):
        before = np.full(steps, given[0, i])  # the first value until then
        assert seen[:, i].tolist() == [*before, *given[: 20 - steps, i]]


def test_restart_begins_again_with_the_next_value() -> None:
    block = control.Delay(2, 3)
    memory = block.memory
    for value in (1.0, 2.0, 3.0, 4.0):
        for i in range(2):
            control.delay(memory, block.parameters, i, value)
    control.restart(memory, 1, 2)
    assert control.delay(memory, block.parameters, 0, 9.0) == 2.0
    assert [control.delay(memory, block.parameters, 1, v) for v in (9.0, 8.0, 7.0, 6.0)] == [
        *[9.0] * 3,
        9.0,
    ]
    assert control.delay(memory, block.parameters, 1, 5.0) == 8.0


@pytest.mark.parametrize("steps", [-1, 1.5, [1, 2, 3], [1, -2], float("nan"), [[1, 2]]])
def test_invalid_delays_are_refused(steps: object) -> None:
    with pytest.raises(ValueError, match="steps"):
        control.Delay(2, steps)  # type: ignore[arg-type]


def test_parameters_of_another_block_are_refused() -> None:
    block = control.Delay(1, 3)
    with pytest.raises(ValueError, match="not the parameters of a Delay"):
        control.delay(block.memory, control.Pid(1, 1.0).parameters, 0, 1.0)
