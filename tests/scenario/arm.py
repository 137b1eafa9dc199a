"""Cell with the simulated arm of examples/cobot."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

import catenary as cat
from catenary.link import FaultInjector
from catenary.virtual import Joint, Plant, Segment, Servo, read_segment

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot"
COUNTS = 131072


@dataclass
class ArmCell:
    segment: Segment
    link: FaultInjector
    main: cat.MainDevice
    plant: Plant

    @property
    def servos(self) -> list[Servo]:
        return [device for device in self.segment if isinstance(device, Servo)]

    @property
    def joints(self) -> npt.NDArray[np.float64]:
        """Joint angles in MuJoCo [rad]."""
        return self.plant.data.qpos.copy()

    def let_pass(self, seconds: float) -> None:
        """Let time pass without a MainDevice."""
        self.link.wait_until(self.link.now() + round(seconds * 1e9), False)

    def drives(self, **options: object) -> cat.Drives:
        joints = self.plant.joints
        given = {
            "counts_per_turn": COUNTS,
            "velocity_limit": 3.0,
            "gear_ratio": [joint.gear for joint in joints],
            "direction": [joint.direction for joint in joints],
            "offset": [joint.zero for joint in joints],
        }
        return cat.Drives(self.main.subs.drives, **{**given, **options})  # type: ignore[arg-type]


@contextmanager
def arm_cell(*, start: list[float], **joint: object) -> Iterator[ArmCell]:
    """Yield the arm of the example at `start` [rad], with the options `joint` for all joints."""
    example = read_segment(COBOT / "segment.toml")
    assert example.plant is not None
    servos = [servo for servo in example if isinstance(servo, Servo)]
    joints = [
        Joint(j.name, j.gear, j.direction, start=q, **joint)  # type: ignore[arg-type]
        for j, q in zip(example.plant.joints, start, strict=True)
    ]
    plant = Plant(COBOT / "arm.xml", joints)
    segment = Segment([_like(servo) for servo in servos], plant=plant)
    link = FaultInjector(segment)
    with cat.MainDevice(link) as main:
        main.scan()
        yield ArmCell(segment, link, main, plant)


def _like(servo: Servo) -> Servo:
    return Servo(
        name=servo.name,
        counts_per_turn=servo.counts_per_turn,
        inertia=servo.inertia,
        viscous_friction=servo.viscous_friction,
        coulomb_friction=servo.coulomb_friction,
        rated_torque=servo.rated_torque,
        max_velocity=servo.max_velocity,
        position_limits=servo.position_limits,
        following_error_turns=servo.following_error_turns,
    )
