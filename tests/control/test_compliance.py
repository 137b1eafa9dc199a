"""Impedance, natural admittance, feed-forward and friction, on a simulated axis with friction."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from catenary import control

DT = 500e-6
INERTIA, VISCOUS, COULOMB = 0.01, 0.05, 0.1


def driven(
    step: Callable[[float, float, float], float],
    seconds: float,
    external: Callable[[float], float] = lambda t: 0.0,
    *,
    coulomb: float = COULOMB,
    q: float = 0.0,
) -> np.ndarray:
    """Return position, velocity and torque (k, 3) of an axis with dry and viscous friction."""
    v, track = 0.0, []
    for k in range(round(seconds / DT)):
        torque = step(q, v, external(k * DT))
        net = torque + external(k * DT) - VISCOUS * v
        v += net * DT / INERTIA
        dry = coulomb * DT / INERTIA
        v = 0.0 if abs(v) <= dry else v - math.copysign(dry, v)
        q += v * DT
        track.append((q, v, torque))
    return np.array(track)


def spring(**options: float) -> Callable[[float, float, float], float]:
    block = control.Impedance(1, 5.0, 0.4, INERTIA, VISCOUS, **options)
    memory, parameters = block.memory, block.parameters
    return lambda q, v, _: control.impedance(memory, parameters, 0, 0.0, 0, 0, 0, q, v, DT)


@pytest.mark.parametrize("push", [0.5, 1.0, -2.0])
def test_the_axis_yields_with_the_stiffness_of_the_spring(push: float) -> None:
    """Without friction, the ratio of static torque to displacement is the stiffness."""
    end = driven(spring(), 3.0, lambda t: push, coulomb=0.0)[-1]
    assert push / end[0] == pytest.approx(5.0, rel=1e-3)


def test_the_observer_compensates_dry_friction() -> None:
    """At 0.015 rad, the spring torque of 0.075 N·m is below the dry friction of 0.1 N·m."""
    assert driven(spring(), 2.0, q=0.015)[-1, 0] == pytest.approx(0.015)
    freed = driven(spring(bandwidth=100.0, compensation=COULOMB), 2.0, q=0.015)
    assert abs(freed[-1, 0]) < 0.005


def test_the_axis_still_yields_with_limited_compensation() -> None:
    """The spring torque balances a push of 2 N·m, minus friction and compensation."""
    pushed = driven(spring(bandwidth=100.0, compensation=COULOMB), 3.0, lambda t: 2.0)
    assert 5.0 * pushed[-1, 0] == pytest.approx(2.0 - COULOMB, abs=COULOMB + 1e-6)
    rigid = driven(spring(bandwidth=100.0), 3.0, lambda t: 2.0)
    assert abs(rigid[-1, 0]) < 0.02  # without a limit the observer also compensates the push


def test_with_a_sensor_the_observer_compensates_all_friction() -> None:
    block = control.Impedance(1, 5.0, 0.4, INERTIA, VISCOUS, bandwidth=100.0)
    memory, parameters = block.memory, block.parameters
    end = driven(
        lambda q, v, felt: control.impedance(memory, parameters, 0, 0, 0, 0, felt, q, v, DT),
        3.0,
        lambda t: 1.0,
        coulomb=3 * COULOMB,
    )[-1]
    assert 1.0 / end[0] == pytest.approx(5.0, rel=0.05)


def test_the_observer_is_the_low_passed_disturbance() -> None:
    """The estimate of a known disturbance is the disturbance filtered by w / (s + w)."""
    block = control.Impedance(1, 0.0, 0.0, INERTIA, VISCOUS, bandwidth=50.0)
    memory, parameters, v, seen = block.memory, block.parameters, 0.0, []
    share = 1 - math.exp(-VISCOUS * DT / INERTIA)
    for _ in range(400):
        torque = control.impedance(memory, parameters, 0, 0, 0, 0, 0, 0, v, DT)
        seen.append(torque)
        v += share * (
            (torque - 0.2) / VISCOUS - v
        )  # exact for a torque that is constant during the period
    time = DT * np.arange(400)
    assert seen == pytest.approx(0.2 * (1 - np.exp(-50.0 * time)), abs=0.006)


def test_impedance_limits_its_torque() -> None:
    block = control.Impedance(1, 100.0, 0.0, limit=2.0)
    args = (0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, DT)
    assert control.impedance(block.memory, block.parameters, *args) == 2.0


def test_an_observer_needs_the_inertia() -> None:
    with pytest.raises(ValueError, match=r"inertia of axis 1 is 0; the observer .* needs"):
        control.Impedance(2, 1.0, 1.0, [0.1, 0.0], bandwidth=10.0)


def admitted(gain: float, coulomb: float) -> np.ndarray:
    block = control.NaturalAdmittance(1, INERTIA, 0.3, 4.0, gain)
    memory, parameters = block.memory, block.parameters
    return driven(
        lambda q, v, felt: control.natural_admittance(
            memory, parameters, 0, 0.0, 0.0, felt, q, v, DT
        ),
        4.0,
        lambda t: 0.5 if t < 2.0 else 0.0,
        coulomb=coulomb,
    )


def test_natural_admittance_moves_as_if_there_were_no_friction() -> None:
    """The axis follows the differential equation of the model; without the loop it does not."""
    q = v = 0.0
    model = []
    for k in range(8000):
        v += ((0.5 if k < 4000 else 0.0) - 4.0 * q - 0.3 * v) * DT / INERTIA
        q += v * DT
        model.append(q)
    follows = abs(admitted(20.0, COULOMB)[:, 0] - model).max()
    sticks = abs(admitted(0.0, COULOMB)[:, 0] - model).max()
    assert follows < 0.012
    assert sticks > 2 * follows


def test_feed_forward_is_inertia_and_damping() -> None:
    block = control.FeedForward(2, [0.1, 0.2], 3.0)
    assert control.feed_forward(block.parameters, 1, 2.0, 5.0) == pytest.approx(7.0)


def test_friction_is_viscous_plus_smoothed_coulomb() -> None:
    block = control.Friction(1, 0.5, 2.0, 0.01)
    assert control.friction(block.parameters, 0, 1.0) == pytest.approx(2.5)
    assert control.friction(block.parameters, 0, -1.0) == pytest.approx(-2.5)
    assert control.friction(block.parameters, 0, 0.0) == 0.0
    assert control.friction(block.parameters, 0, 0.01) == pytest.approx(0.005 + 2 * math.tanh(1))
