"""P+d coupling: the condition, and its behaviour under varying delay, in contact, without a link.

The devices are simulated with steps of 0.1 ms and sampled at 1 ms (`two_sides`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest

from catenary import control
from tests.control.two_sides import PERIOD, Delay, Side, Torque, constant, lossy

K, B = 2.0, 0.05


def made(stiffness: float = K, damping: float = B, delay: float = 0.04, **more) -> control.Coupling:
    return control.Coupling(1, stiffness, damping, delay, PERIOD, **more)


def hand(goal: Callable[[float], float]) -> Torque:
    """Return a passive hand: a spring and a damper that follow a path."""
    return lambda time, q, v: 20.0 * (goal(time) - q) - 0.2 * v


def wall(place: float) -> Torque:
    return lambda time, q, v: -2000.0 * (q - place) - 2.0 * v if q > place else 0.0


def run(
    left: Side,
    right: Side,
    ages: Callable[[int], Callable[[], int]],
    *,
    seconds: float = 3.0,
    gains: tuple[float, float] = (K, B),
) -> tuple[np.ndarray, np.ndarray]:
    """Couple two sides without the check of the condition. Return both paths [rad]."""
    block = control.Coupling(1, gains[0], gains[1], 0.0, 1e-9, align=1e9)
    sides, memories = (left, right), (block.memory, block.memory)
    lines = Delay(ages(1), right.position), Delay(ages(2), left.position)
    for k in range(int(seconds / PERIOD)):
        heard = lines[0].step(k, right.position), lines[1].step(k, left.position)
        for side, memory, peer in zip(sides, memories, heard, strict=True):
            q, v = side.position, side.velocity
            torque = control.coupling(memory, block.parameters, 0, peer, 1.0, q, v, PERIOD)
            side.step(k * PERIOD, torque)
    return np.array(left.positions), np.array(right.positions)


@pytest.mark.parametrize(("stiffness", "damping", "delay"), [(2, 0.2, 0.5), (100, 0.3, 0.0)])
def test_gains_beyond_the_condition_are_refused_with_gains_that_are_enough(
    stiffness: float, damping: float, delay: float
) -> None:
    with pytest.raises(ValueError, match=r"permit .* in both directions together") as refused:
        made(stiffness, damping, delay)
    enough, softer = map(float, re.findall(r"to ([\d.e-]+) N·m", str(refused.value)))
    assert made(stiffness, enough, delay).longest_delay[0] > delay
    assert made(softer, damping, delay).longest_delay[0] > delay


def test_a_weak_damping_of_the_other_side_is_named() -> None:
    """The own B / K of 100 ms is enough, so the message does not advise less damping."""
    with pytest.raises(ValueError, match=r"on both sides is enough: ") as refused:
        made(2.0, 0.2, 0.05, peer=(2.0, 0.01))
    assert "at the other side, raise the damping or lower the stiffness" in str(refused.value)
    assert "to 0." not in str(refused.value)


def test_the_condition_has_the_product_of_both_sides() -> None:
    """4 (B_l - K_l δ) (B_r - K_r δ) > (D + 2 δ)² K_l K_r with δ = 2 ms."""
    both = made(2.0, 0.1, 0.05, peer=(8.0, 0.2))
    d = both.longest_delay[0]
    assert pytest.approx((d + 4e-3) ** 2 * 16) == 4 * (0.1 - 2 * 2e-3) * (0.2 - 8 * 2e-3)
    made(2.0, 0.1, d - 1e-6, peer=(8.0, 0.2))
    with pytest.raises(ValueError, match="permit"):
        made(2.0, 0.1, d + 1e-6, peer=(8.0, 0.2))


def test_a_damping_that_acts_too_late_for_the_inertia_is_refused() -> None:
    with pytest.raises(ValueError, match=r"4 ms late.*oscillate; use at most 0\.05"):
        control.Coupling(1, 1.0, 0.06, 0.01, 2e-3, inertia=2e-4)
    control.Coupling(1, 1.0, 0.04, 0.01, 2e-3, inertia=2e-4)


def hold(row: np.ndarray) -> float:
    """Hold an axis that was pushed, without a link. Return the amplitude after 3 s [rad]."""
    side, memory = Side(velocity=0.1), made().memory
    for k in range(3000):
        q, v = side.position, side.velocity
        side.step(k * PERIOD, control.coupling(memory, row, 0, 0.0, 0.0, q, v, PERIOD))
    return float(np.ptp(side.positions[-500:]))


def test_a_stiffness_of_holding_that_oscillates_is_refused() -> None:
    row = made().parameters
    row[5] = 50.0
    assert hold(row) > 1e3
    assert hold(made(hold=24.0).parameters) < 1e-6
    with pytest.raises(ValueError, match=r"hold of axis 0 is 50 .*below 25 N·m/rad"):
        made(hold=50.0)


@pytest.mark.parametrize("delay", [-1.0, math.nan, math.inf])
def test_an_invalid_delay_is_refused(delay: float) -> None:
    with pytest.raises(ValueError, match="delay="):
        made(delay=delay)


def test_both_sides_meet_after_a_disturbance_and_stay_together() -> None:
    left, right = run(Side(position=0.4), Side(position=-0.2), lossy_pair, seconds=4.0)
    assert abs(left[-1] - right[-1]) < 1e-6
    assert abs(np.diff(left[-500:])).max() < 1e-9  # no drift


def lossy_pair(seed: int) -> Callable[[], int]:
    """Return varying ages up to 20 ms with a loss of 5 %."""
    return lossy(18, 0.05, seed)


def test_the_follower_follows_a_hand_through_varying_delay_and_losses() -> None:
    left, right = run(
        Side(outside=hand(lambda t: 0.5 * min(t, 1.0))), Side(), lossy_pair, seconds=3.0
    )
    assert left[-1] == pytest.approx(0.5, abs=1e-3)
    assert right[-1] == pytest.approx(left[-1], abs=1e-3)


def test_the_hand_feels_a_contact_of_the_follower_through_the_spring() -> None:
    """In contact, hand spring 20 and coupling K are in series: q = (20 · 0.5 + K · 0.2) / 22."""
    left, right = run(
        Side(outside=hand(lambda t: 0.5 * min(t, 1.0))), Side(outside=wall(0.2)), lossy_pair
    )
    assert right[-1] == pytest.approx(0.2, abs=1e-3)
    assert left[-1] == pytest.approx((20 * 0.5 + K * 0.2) / 22, abs=1e-3)


def test_without_enough_damping_the_same_delay_is_unstable() -> None:
    """The check refuses these gains for a reason."""
    gains = K, 0.01
    with pytest.raises(ValueError, match="permit"):
        made(*gains, delay=0.08)
    left, _ = run(Side(position=0.1), Side(), lambda _: constant(40), gains=gains)
    assert abs(left[-1000:]).max() > 1.0
    left, _ = run(
        Side(position=0.1), Side(), lambda _: constant(40), gains=(K, 1.01 * K * (0.04 + 4e-3))
    )
    assert abs(left[-1000:] - left[-1]).max() < 1e-3


def one(memory: np.ndarray, block: control.Coupling, peer: float, q: float, on: float = 1.0):
    return control.coupling(memory, block.parameters, 0, peer, on, q, 0.0, PERIOD)


def test_without_a_link_the_axis_holds_its_position_with_the_stated_stiffness() -> None:
    block = made(hold=5.0)
    memory = block.memory
    assert one(memory, block, 0.3, 0.3) == 0.0
    assert one(memory, block, 9.9, 0.3, on=0.0) == 0.0
    assert one(memory, block, 9.9, 0.4, on=0.0) == pytest.approx(-0.5)


def test_a_link_that_returns_pulls_with_the_speed_of_alignment() -> None:
    block = made(align=0.5)
    memory = block.memory
    one(memory, block, 0.0, 0.3, on=0.0)
    torques = [one(memory, block, 1.3, 0.3) for _ in range(3000)]
    assert torques[0] == pytest.approx(K * 0.5 * PERIOD)
    assert np.diff(torques).max() == pytest.approx(K * 0.5 * PERIOD)
    assert torques[-1] == pytest.approx(K * 1.0)


@pytest.mark.parametrize("held", [2.0, 5.0])
def test_a_link_that_returns_keeps_the_torque_of_an_axis_that_is_pushed(held: float) -> None:
    block = made(hold=held, align=0.5, deflection=0.3)
    memory = block.memory
    for q in (0.3, 0.5):
        pushed = one(memory, block, 0.0, q, on=0.0)
    assert pushed == pytest.approx(max(-held * 0.2, -K * 0.3))
    torques = [pushed, *(one(memory, block, 0.9, 0.5) for _ in range(3000))]
    assert abs(np.diff(torques)).max() == pytest.approx(K * 0.5 * PERIOD)
    assert torques[-1] == pytest.approx(K * 0.3)  # limited


@pytest.mark.parametrize("peer", [math.nan, math.inf])
def test_a_position_that_is_not_finite_counts_as_a_lost_link(peer: float) -> None:
    block = made()
    memory = block.memory
    one(memory, block, 0.0, 0.0)
    assert one(memory, block, peer, 0.2) == 0.0
    assert one(memory, block, peer, 0.3) == pytest.approx(-K * 0.1)


def test_the_deflection_limits_the_spring_but_not_the_damper() -> None:
    block = made(deflection=0.1, align=1e9)
    memory = block.memory
    torque = control.coupling(memory, block.parameters, 0, 5.0, 1.0, 0.0, -1.0, PERIOD)
    assert torque == pytest.approx(K * 0.1 + B)


def test_the_scale_multiplies_the_received_position() -> None:
    block = made(scale=0.5, align=1e9)
    assert one(block.memory, block, 1.0, 0.0) == pytest.approx(K * 0.5)


def test_other_parameters_are_refused() -> None:
    block = control.Pid(1, 1.0)
    with pytest.raises(ValueError, match="not the parameters of a Coupling"):
        control.coupling(made().memory, block.parameters, 0, 0.0, 1.0, 0.0, 0.0, PERIOD)


def test_different_stiffnesses_and_a_scale_change_the_torque_that_is_felt() -> None:
    """The leader moves twice as far. At rest, it feels K_l scale / K_r of the torque."""
    leader = control.Coupling(1, 1.0, 0.06, 0.02, PERIOD, peer=(8.0, 0.3), scale=2.0, align=1e9)
    follower = control.Coupling(1, 8.0, 0.3, 0.02, PERIOD, peer=(1.0, 0.06), scale=0.5, align=1e9)
    sides = Side(outside=hand(lambda t: 0.5 * min(t, 1.0))), Side(outside=wall(0.1))
    memories = leader.memory, follower.memory
    lines = Delay(constant(10), 0.0), Delay(constant(10), 0.0)
    for k in range(3000):
        heard = lines[0].step(k, sides[1].position), lines[1].step(k, sides[0].position)
        for side, block, memory, peer in zip(
            sides, (leader, follower), memories, heard, strict=True
        ):
            q, v = side.position, side.velocity
            torque = control.coupling(memory, block.parameters, 0, peer, 1.0, q, v, PERIOD)
            side.step(k * PERIOD, torque)
    assert sides[1].position == pytest.approx(0.1, abs=1e-3)
    assert sides[0].applied / sides[1].applied == pytest.approx(-1.0 * 2.0 / 8.0, rel=1e-3)
