"""The humanoid balances where plain PD with the same gains falls, and without force sensors."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import body
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import study
from balance import Balance, Gains
from estimate import Estimate, Estimator
from simulation import Control, Noise, Plain, Push, Simulation
from statics import Statics
from study import FEET, LAWS, STIFF, impulse, lost_sensors, outcome, push, simulation, tilt

STANDING = Estimator().standing


def moved(com: tuple[float, float], reliable: bool = True) -> Estimate:
    values = {name: getattr(STANDING, name) for name in Estimate.__slots__}
    place = STANDING.com + np.array([*com, 0.0])
    return Estimate(**{**values, "com": place, "reliable": reliable})


def test_the_floor_carries_the_weight_at_the_static_height() -> None:
    statics = Statics()
    height = statics.place(body.STAND)
    assert abs(height - body.load_model().qpos0[2]) < 1e-3
    assert statics.mass == pytest.approx(100.0, abs=1.0)


def test_the_static_torques_hold_the_pose_without_error() -> None:
    """With plain PD the joints sag by milliradians."""
    held = Simulation().run(Balance(feedback=False), 1.0)
    plain = Simulation().run(Plain(), 1.0)
    assert np.abs(held.com[-1] - held.com[0]).max() < 1e-3
    assert np.abs(plain.com[-1] - plain.com[0]).max() > 5e-3


def test_a_pose_with_turned_soles_is_refused() -> None:
    pose = body.STAND.copy()
    for side in body.SIDES:
        pose[body.INDEX[f"{side}_ankle_pitch"]] = 0.78
    with pytest.raises(ValueError, match="both soles have to be flat"):
        Statics().place(pose)


def test_a_centre_of_mass_ahead_shifts_the_pressure_to_the_toes() -> None:
    balance = Balance()
    _, torque = balance.step(moved((0.01, 0.0)), 1e-3)
    change = torque - balance.static_torque
    for side in body.SIDES:
        assert change[body.INDEX[f"{side}_ankle_pitch"]] > 5.0
    assert abs(change[body.INDEX["left_wrist_roll"]]) < 1.0


def test_the_force_is_limited_and_the_integral_does_not_wind_up() -> None:
    balance = Balance(gains=Gains(reach=(0.05, 0.05)))
    for _ in range(2000):
        balance.step(moved((0.2, 0.0)), 1e-3)
    assert balance.force[0] == pytest.approx(-0.05 * 100.1 * 9.81 / STANDING.com[2], rel=1e-2)
    balance.step(moved((0.0, 0.0)), 1e-3)
    assert abs(balance.force[0]) < 5.0


def test_an_unreliable_estimate_leaves_the_static_torques() -> None:
    balance = Balance()
    goal, torque = balance.step(moved((0.1, 0.1), reliable=False), 1e-3)
    np.testing.assert_array_equal(goal, body.STAND)
    np.testing.assert_array_equal(torque, balance.static_torque)


def test_reset_starts_again() -> None:
    balance = Balance()
    first = balance.step(moved((0.01, 0.01)), 1e-3)[1]
    for _ in range(100):
        balance.step(moved((0.01, 0.01)), 1e-3)
    balance.reset()
    np.testing.assert_array_equal(balance.step(moved((0.01, 0.01)), 1e-3)[1], first)


def test_the_results_belong_to_the_caller() -> None:
    """A task may change them for other joints."""
    balance = Balance()
    goal, torque = balance.step(moved((0.0, 0.0), reliable=False), 1e-3)
    goal[:], torque[:] = 9.0, 9.0
    np.testing.assert_array_equal(balance.step(moved((0.0, 0.0)), 1e-3)[0], body.STAND)
    assert np.abs(balance.static_torque).max() != 9.0


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_it_stands_under_a_push_of_60_n_and_plain_pd_falls(direction: str) -> None:
    assert push("plain PD", direction).fall
    stands = push("balance", direction)
    assert not stands.fall
    assert abs(stands.com[-1, 0] - stands.com[0, 0]) < 0.005


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_it_stands_on_a_slope_of_4_degrees_and_plain_pd_falls(direction: str) -> None:
    assert tilt("plain PD", direction).fall
    assert not tilt("balance", direction).fall


def test_it_stands_within_10_mm_with_noisy_sensors() -> None:
    run = Simulation(noise=Noise()).run(Balance(), 3.0)
    assert not run.fall
    quiet = run.com[run.time > 1.0]
    assert np.ptp(quiet[:, :2], axis=0).max() < 0.010
    assert np.std(run.torque[1000:], axis=0).max() > 0.1  # the noise reaches the drives


@pytest.mark.parametrize("lost", [FEET[:1], FEET], ids=["one foot", "both feet"])
def test_it_stands_without_force_sensors(lost: tuple[str, ...]) -> None:
    assert lost_sensors("balance", lost) == ""


def test_it_falls_without_the_imu() -> None:
    """The stated rule: the robot cannot balance without it, so that the program has to damp."""
    pushes = (Push((60.0, 0.0), 0.2),)
    run = Simulation(lost=("imu_orientation",)).run(Balance(), 3.0, pushes, lose=0.1)
    assert run.com[-1, 0] - run.com[0, 0] > 0.2


def test_it_recovers_from_a_larger_impulse_than_plain_pd(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = impulse("plain PD", "backward", 6.0)
    monkeypatch.setattr(study, "IMPULSES", (plain, plain + 12.0))  # one run, with 6 N·s more
    assert impulse("balance", "backward", 6.0) == plain + 6.0


def test_one_more_comparison_has_stiff_joints() -> None:
    stiff = simulation(STIFF)._stiffness
    assert stiff[body.INDEX["left_ankle_pitch"]] == stiff[body.INDEX["right_ankle_pitch"]] == 3200
    np.testing.assert_array_equal(simulation("balance")._stiffness, body.STIFFNESS)


def test_an_outcome_names_the_directions_of_falls() -> None:
    fast = Simulation().run(Plain(), 3.0, (Push((400.0, 0.0), 0.0),))
    assert outcome({"forward": fast}) == f"falls: forward {fast.time[-1]:.1f} s"
    assert outcome({}) == "stands"


@pytest.mark.parametrize("make", [Balance, LAWS["LQR"]], ids=["balance", "LQR"])
def test_a_process_can_rebuild_it(make: Callable[[], Control]) -> None:
    original = make()
    copy = pickle.loads(pickle.dumps(original))
    first, second = (each.step(moved((0.01, 0.0)), 1e-3)[1] for each in (original, copy))
    np.testing.assert_array_equal(first, second)
