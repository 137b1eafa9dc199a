"""Rows that combine several blocks, and the checks of options."""

import math

import numpy as np
import pytest

from catenary import control


def test_parts_are_views_of_the_joined_row() -> None:
    row = control.join([1.0, 2.0], [], np.array([[3.0, 4.0], [5.0, 6.0]]))
    assert control.part(row, 0).tolist() == [1.0, 2.0]
    assert control.part(row, 1).tolist() == []
    assert control.part(row, 2).tolist() == [3.0, 4.0, 5.0, 6.0]
    control.part(row, 2)[0] = 7.0
    assert control.part(row, 2)[0] == 7.0


@pytest.mark.parametrize("k", [-1, 2])
def test_a_missing_part_is_refused(k: int) -> None:
    with pytest.raises(IndexError, match="no part with this number"):
        control.part(control.join([1.0], [2.0]), k)


def test_restart_resets_one_axis_only() -> None:
    memory = np.arange(1.0, 7.0)
    control.restart(memory, 1, 3)
    assert memory.tolist() == [1.0, 2.0, 0.0, 0.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"proportional": [1.0, 2.0]}, "give one value, or one for each of 3 axes"),
        ({"proportional": [1.0, float("nan"), 1.0]}, "proportional of axis 1 is nan"),
        ({"proportional": 1.0, "limit": 0.0}, "limit of axis 0 is 0.0; it must be above 0.0"),
        ({"proportional": 1.0, "integral": [1, 1, -1]}, "integral of axis 2 is -1.0"),
    ],
)
def test_an_invalid_option_is_refused_by_the_constructor(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.Pid(3, **options)


def test_a_step_of_all_axes_at_once() -> None:
    block = control.Cascade(control.Pid(3, 20.0, limit=2.0), control.Pid(3, [1.0, 2.0, 3.0], 4.0))
    goal, q, v = np.array([0.1, 0.2, 0.3]), np.zeros(3), np.array([0.0, 0.1, 0.2])
    one, other = block.memory, block.memory
    for _ in range(5):
        torque = control.every(control.cascade, (one, block.parameters), goal, 0.0, 0.5, q, v, 1e-3)
        expected = [
            control.cascade(other, block.parameters, i, goal[i], 0.0, 0.5, q[i], v[i], 1e-3)
            for i in range(3)
        ]
        assert torque.tolist() == expected
    assert one.tolist() == other.tolist()
    rubbing = control.Friction(3, 1.0, 0.0)
    assert control.every(control.friction, (rubbing.parameters,), v) == pytest.approx(v)


@pytest.mark.parametrize("inputs", [(), (0.1, 0.2), (np.zeros(2), np.zeros(3))])
def test_inputs_without_a_number_of_axes_are_refused(inputs: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"every: give at least one|broadcast"):
        control.every(control.friction, (control.Friction(2, 1.0, 0.0).parameters,), *inputs)


STEPS = {
    "pid": (control.Pid(1, 2.0, 3.0, 0.1, limit=5.0, rate=9.0), control.pid, 3),
    "cascade": (
        control.Cascade(control.Pid(1, 9.0, limit=2.0), control.Pid(1, 2.0, limit=5.0)),
        control.cascade,
        5,
    ),
    "impedance": (control.Impedance(1, 2.0, 3.0, 0.1, 0.1, 99.0, 0.1, 5.0), control.impedance, 6),
    "admittance": (
        control.NaturalAdmittance(1, 0.1, 1.0, 2.0, 3.0, 5.0),
        control.natural_admittance,
        5,
    ),
    "residual": (control.Residual(1, 50.0, 0.1), control.residual, 2),
}


@pytest.mark.parametrize("name", STEPS)
def test_nan_inputs_give_nan_not_a_limit(name: str) -> None:
    block, step, inputs = STEPS[name]
    for wrong in range(inputs):
        memory = block.memory
        step(memory, block.parameters, 0, *[0.5] * inputs, 1e-3)
        values = [0.5] * inputs
        values[wrong] = math.nan
        assert math.isnan(step(memory, block.parameters, 0, *values, 1e-3))
        control.restart(memory, 0, 1)
        assert math.isfinite(step(memory, block.parameters, 0, *[0.5] * inputs, 1e-3))


def test_the_parameters_of_settings_are_computed_once_and_returned_as_copies() -> None:
    stiffness = np.array([1.0, 2.0])
    spring = control.Residual(2, gain=stiffness)
    first = spring.parameters
    stiffness[:] = -1.0  # invalid, but the settings have been checked before
    expected = first.tolist()
    first[1] = 9.0
    assert spring.parameters.tolist() == expected
    assert control.Residual(2, gain=[1.0, 2.0]).parameters.tolist() == expected
