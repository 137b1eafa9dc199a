"""The example arm with a complete MainDevice: SYNC0, shared clock, reproducibility."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

import catenary as cat
from catenary.realtime import VirtualClock
from catenary.virtual import Crystal, Plant, Segment, Servo, read_segment

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot"
GEARS = {"gear_ratio": [121.0] * 3 + [101.0] * 3, "direction": [1, 1, -1, 1, -1, 1]}
Values = npt.NDArray[np.float64]


def example() -> Segment:
    return read_segment(COBOT / "segment.toml")


def sway(segment: Segment, **options: object) -> tuple[Values, Values]:
    """Return positions and targets of 500 cycles of a smooth motion in CSP [rad]."""
    positions, targets = [], []
    with cat.MainDevice(segment) as main:
        given = {"counts_per_turn": 131072, "velocity_limit": 3.0, **GEARS, **options}
        arm = cat.Drives(main.scan().drives, **given)  # type: ignore[arg-type]
        with cat.Loop(arm, period=1e-3) as loop:
            if options.get("dc"):
                loop.wait_locked(timeout=30)
            first = arm.actual.position.copy()
            for k, _cycle in enumerate(loop):
                arm.target.position[:] = first + 0.3 * (1 - math.cos(4e-3 * k))
                positions.append(arm.actual.position.copy())
                targets.append(arm.target.position.copy())
                if k == 500:
                    break
    return np.array(positions), np.array(targets)


def worst(positions: Values, targets: Values, lag: int) -> float:
    """Return the largest following error [rad]. A target takes effect after `lag` cycles."""
    return float(np.abs(positions[lag:] - targets[:-lag]).max())


def test_an_arm_follows_in_position_control() -> None:
    """The maximum speed is 1.2 rad/s, so an error of one cycle would be 1.2e-3 rad."""
    assert worst(*sway(example()), lag=2) < 4e-4


def test_servos_synchronised_to_sync0_move_the_arm() -> None:
    """The plant uses none of the six clocks, so pulses occur between its steps."""
    segment = example()
    for k, device in enumerate(segment):
        device.crystal = Crystal(ppm=20.0 * k - 50)
    assert worst(*sway(segment, dc=True), lag=3) < 6e-4


def test_two_runs_are_identical() -> None:
    first, second = sway(example()), sway(example())
    assert first[0].tobytes() == second[0].tobytes()
    assert first[1].tobytes() == second[1].tobytes()


def test_plant_runs_on_a_shared_clock() -> None:
    """The number of steps agrees with the time of the shared clock."""
    plant = Plant(COBOT / "arm.xml")
    segment = Segment([Servo(axes=6)], plant=plant, clock=VirtualClock())
    link = segment.open_link()
    began = link.now()
    link.wait_until(began + 1_000_000_000, False)
    assert plant.steps == 4000
    assert link.now() == began + 1_000_000_000
