"""The rig of the scenarios with gravity: one vertical axis with a holding brake, in MuJoCo.

    with vertical_cell(quirks=ServoQuirks(quick_stop_option=0)) as cell:
        arm = cell.drives(mode="cst", velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                arm.target.torque[:] = cell.gravity
                ...
                before = cell.joint
            ...
        assert cell.fall(before) < cell.fall_bound(reaction=0.011)

Angles and torques are the joint's: motor angle = gear · joint angle, drive torque · gear = joint
torque. One per mille of the drive's torque is 0.05 N·m at the joint.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco

import catenary as cat
from catenary.link import FaultInjector
from catenary.virtual import Joint, Plant, Segment, Servo, ServoQuirks

MODEL = Path(__file__).with_name("vertical.xml")
COUNTS = 131072  # per turn of the motor
GEAR = 50.0
RATED_TORQUE = 1.0  # N·m of the motor; the load needs half of it
LOAD = 25.0  # N·m at the joint, of vertical.xml with the arm horizontal
BRAKE = 150.0  # likewise
STEP = 250e-6  # s, of the servo and of the simulation
NO_QUIRKS = ServoQuirks()


@dataclass
class VerticalCell:
    """The rig, scanned: a MainDevice on a segment of one servo that moves the arm."""

    segment: Segment
    link: FaultInjector
    main: cat.MainDevice
    plant: Plant
    servo: Servo
    brake: float  # N·m at the joint
    brake_delay: float  # s
    gravity: float  # N·m at the joint that hold the arm where it started
    g_eff: float  # rad/s², acceleration of the free fall from the horizontal: the fastest

    @property
    def joint(self) -> float:
        """MuJoCo's own joint angle [rad]; 0 is horizontal, positive is up."""
        return float(self.plant.data.qpos[0])

    @property
    def velocity(self) -> float:
        """MuJoCo's own joint velocity [rad/s]."""
        return float(self.plant.data.qvel[0])

    @property
    def torque(self) -> float:
        """Torque of the drive at the joint [N·m]."""
        return self.servo.torque_nm * GEAR

    @property
    def powered(self) -> bool:
        """True if the drive is in OPERATION ENABLED."""
        return self.servo.drive_state() == "OPERATION ENABLED"

    def fall(self, before: float) -> float:
        """Return how far the arm is below the angle `before` [rad]."""
        return before - self.joint

    def fall_bound(self, reaction: float) -> float:
        """Return the bound of a fall from rest [rad].

        It is ½·g_eff·t² plus the way on which the closed brake stops the arm, which is
        load / (brake - load) times as long. t is the sum of `reaction`, the brake's delay and two
        steps of the drive. `reaction` [s]: time without torque while the drive is powered.
        """
        seconds = reaction + self.brake_delay + 2 * STEP
        return 0.5 * self.g_eff * seconds**2 * (1 + LOAD / (self.brake - LOAD))

    def let_pass(self, seconds: float) -> None:
        """Let time pass without a MainDevice."""
        self.link.wait_until(self.link.now() + round(seconds * 1e9), False)

    def drives(self, **options: object) -> cat.Drives:
        """Return the axis as an application declares it; `options` as of `cat.Drives`."""
        given = {"counts_per_turn": COUNTS, "gear_ratio": GEAR}
        return cat.Drives(self.main.subs.drives, **{**given, **options})  # type: ignore[arg-type]


def _at_rest(plant: Plant, angle: float) -> mujoco.MjData:
    """Return MuJoCo's state with the arm at rest at `angle`, without motor torque."""
    data = mujoco.MjData(plant.model)
    data.qpos[0] = angle
    mujoco.mj_forward(plant.model, data)
    return data


@contextmanager
def vertical_cell(
    *,
    start: float = 0.0,
    quirks: ServoQuirks = NO_QUIRKS,
    brake_delay: float = 0.030,
    brake: float = BRAKE,
    **servo: object,
) -> Iterator[VerticalCell]:
    """Set the rig up with the arm on its brake at `start` [rad], and scan it. `servo`: options of
    `Servo`."""
    options = {
        "counts_per_turn": COUNTS,
        "inertia": 1e-4,
        "viscous_friction": 1e-5,
        "coulomb_friction": 0.005,
        "rated_torque": RATED_TORQUE,
        "max_velocity": 500.0,
        "following_error_turns": 1.0,
    }
    motor = Servo(name="lift", quirks=quirks, **{**options, **servo})  # type: ignore[arg-type]
    joint = Joint("shoulder", GEAR, start=start, brake=brake, brake_delay=brake_delay)
    plant = Plant(MODEL, [joint])
    segment = Segment([motor], plant=plant)
    link = FaultInjector(segment)
    with cat.MainDevice(link) as main:
        main.scan()
        yield VerticalCell(
            segment,
            link,
            main,
            plant,
            motor,
            brake,
            brake_delay,
            gravity=float(_at_rest(plant, start).qfrc_bias[0]),
            # unconstrained: without the dry friction, which a closed brake is too
            g_eff=-float(_at_rest(plant, 0.0).qacc_smooth[0]),
        )
