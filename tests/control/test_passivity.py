"""Observer and controller of the energy at both ports of a coupling."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from catenary import control
from tests.control.two_sides import PERIOD, Delay, Side, constant, lossy

K = 2.0


class Port(NamedTuple):
    """Message of one side: position, time of sending, energies, time of the newest received."""

    position: float = 0.0
    sent: int = 0
    taken: float = 0.0
    returned: float = 0.0
    heard: int = 0


def observe(
    ages: Callable[[int], Callable[[], int]],
    damping: float,
    *,
    controller: float = 0.0,
    seconds: float = 3.0,
    start: float = 0.0,
) -> tuple[list[Side], list[control.Energies], float]:
    """Couple two sides with an observer at each. Return the sides, energies and tolerance."""
    block = control.Coupling(1, K, damping, 0.0, 1e-9, align=1e9)
    watch = control.Passivity(1, K, 5.0, PERIOD, quantum=6e-6, damping=controller)
    push = lambda time, q, v: 0.4 * math.sin(9.0 * time) if time < 1.5 else 0.0  # noqa: E731
    sides = [Side(outside=push), Side()]
    sides[0].velocity = start
    lines = [Delay(ages(1), Port()), Delay(ages(2), Port())]
    springs, ports = [block.memory, block.memory], [watch.memory, watch.memory]
    own = [[Port()], [Port()]]
    heard = [Port(), Port()]
    for k in range(int(seconds / PERIOD)):
        for i in (0, 1):
            other = lines[i].step(k, own[1 - i][-1])
            heard[i] = other  # type: ignore[call-overload]
        for i, side in enumerate(sides):
            q, v, other = side.position, side.velocity, heard[i]
            torque = control.coupling(
                springs[i], block.parameters, 0, other.position, 1.0, q, v, PERIOD
            )
            echo = own[i][other.heard].returned
            remote = other.taken - other.returned - echo
            torque = control.passivity(ports[i], watch.parameters, 0, torque, remote, q, v, PERIOD)
            energy = control.energies(ports[i])
            own[i].append(
                Port(q, k + 1, float(energy.taken[0]), float(energy.returned[0]), other.sent)
            )
            side.step(k * PERIOD, torque)
    return sides, [control.energies(port) for port in ports], float(watch.tolerance[0])


def test_a_coupling_that_fulfils_the_condition_stays_above_the_tolerance() -> None:
    damping = 1.05 * K * (0.02 + 4e-3)
    control.Coupling(1, K, damping, 0.04, PERIOD)
    for ages in (lambda _: constant(0), lambda _: constant(20), lambda s: lossy(18, 0.05, s)):
        _, found, tolerance = observe(ages, damping)
        assert min(float(each.least[0]) for each in found) >= -tolerance


def test_an_active_coupling_is_detected_at_both_sides() -> None:
    _, found, tolerance = observe(lambda _: constant(40), 0.005)
    assert all(float(each.least[0]) < -10 * tolerance for each in found)


def test_the_controller_removes_the_energy_that_the_delay_creates() -> None:
    """Without it, the oscillation grows; with it, the motion ends."""
    grows, _, _ = observe(lambda _: constant(40), 0.02)
    assert np.ptp(grows[0].positions[-500:]) > 1e3
    sides, found, _ = observe(lambda _: constant(40), 0.02, controller=0.3)
    assert np.ptp(sides[0].positions[-500:]) < 1e-3  # at rest
    assert all((each.taken >= 0).all() and (each.returned >= 0).all() for each in found)


def test_the_energy_of_a_cycle_is_that_of_the_torque_that_acted_in_it() -> None:
    watch = control.Passivity(1, K, 1.0, PERIOD)
    memory = watch.memory
    for position, torque in ((0.0, 3.0), (0.1, 0.0), (0.3, 0.0), (0.4, 0.0)):
        control.passivity(memory, watch.parameters, 0, torque, 0.0, position, 0.0, PERIOD)
    assert control.energies(memory).returned[0] == pytest.approx(3.0 * 0.2)  # one cycle later
    at_once = control.Passivity(1, K, 1.0, PERIOD, latency=0)
    memory = at_once.memory
    for position, torque in ((0.0, 3.0), (0.1, 0.0), (0.3, 0.0)):
        control.passivity(memory, at_once.parameters, 0, torque, 0.0, position, 0.0, PERIOD)
    assert control.energies(memory).returned[0] == pytest.approx(3.0 * 0.1)


def test_the_tolerance_is_the_energy_of_an_unknown_deflection() -> None:
    watch = control.Passivity(2, [K, 3.0], 5.0, PERIOD, quantum=1e-3)
    wrong = 2 * 2e-3 * 5.0 + 1e-3
    assert watch.tolerance == pytest.approx([K * wrong**2 / 2, 3.0 * wrong**2 / 2])


def test_the_added_damper_is_limited() -> None:
    watch = control.Passivity(1, K, 0.0, PERIOD, damping=0.1)
    row, memory = watch.parameters, watch.memory
    assert control.passivity(memory, row, 0, 1.0, -5.0, 0.0, 2.0, PERIOD) == pytest.approx(0.8)
    assert control.passivity(memory, row, 0, 1.0, -5.0, 0.0, 0.0, PERIOD) == 1.0
    assert control.passivity(memory, row, 0, 1.0, 5.0, 0.0, 2.0, PERIOD) == 1.0


@pytest.mark.parametrize("remote", [math.nan, math.inf, -math.inf])
def test_a_remote_energy_that_is_not_finite_changes_nothing(remote: float) -> None:
    """The torque stays that of the coupling, and the next valid energy is observed again."""
    watch = control.Passivity(1, K, 0.0, PERIOD, damping=0.1)
    row, memory = watch.parameters, watch.memory
    control.passivity(memory, row, 0, 1.0, -0.5, 0.0, 0.0, PERIOD)
    assert control.passivity(memory, row, 0, 1.0, remote, 0.0, 2.0, PERIOD) == 1.0
    found = control.energies(memory)
    assert (found.observed[0], found.least[0]) == (-0.5, -0.5)
    control.passivity(memory, row, 0, 1.0, -0.7, 0.0, 0.0, PERIOD)
    assert control.energies(memory).observed[0] == -0.7


def test_alignment_supplies_at_most_the_stated_energy() -> None:
    """Both sides start 0.5 rad apart. The hand then lets the spring pull it to the follower."""
    block = control.Coupling(1, K, 0.06, 0.04, PERIOD, align=0.5)
    watch = control.Passivity(1, K, 5.0, PERIOD)
    hand = lambda time, q, v: 20.0 * (min(0.5, max(0.9 - 0.2 * time, 0.0)) - q) - 0.2 * v  # noqa: E731
    sides = Side(outside=hand, position=0.5), Side(inertia=1e6)
    springs, ports = (block.memory, block.memory), (watch.memory, watch.memory)
    for k in range(6000):
        positions = [side.position for side in sides]
        found = [control.energies(port) for port in ports]
        for i, side in enumerate(sides):
            q, v = side.position, side.velocity
            torque = control.coupling(
                springs[i], block.parameters, 0, positions[1 - i], 1.0, q, v, PERIOD
            )
            other = found[1 - i].taken - found[1 - i].returned
            remote = float(other[0] - found[i].returned[0])
            control.passivity(ports[i], watch.parameters, 0, torque, remote, q, v, PERIOD)
            side.step(k * PERIOD, torque)
    least = float(control.energies(ports[0]).least[0])
    assert -K * 0.5 * 0.5 - watch.tolerance[0] < least < -100 * watch.tolerance[0]


@pytest.mark.parametrize("latency", [-1, 2])
def test_another_latency_is_refused(latency: int) -> None:
    with pytest.raises(ValueError, match="latency="):
        control.Passivity(1, K, 1.0, PERIOD, latency=latency)


def test_other_parameters_are_refused() -> None:
    watch = control.Passivity(1, K, 1.0, PERIOD)
    row = np.array(control.Pid(1, 1.0).parameters)
    with pytest.raises(ValueError, match="not the parameters of a Passivity"):
        control.passivity(watch.memory, row, 0, 0.0, 0.0, 0.0, 0.0, PERIOD)
