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
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

import catenary as cat
from catenary.link import FaultInjector, Recorder
from catenary.loop.stream import Stream
from catenary.virtual import Joint, Plant, Segment, SercosDrive, Servo, ServoQuirks

MODEL = Path(__file__).with_name("vertical.xml")
COUNTS = 131072  # per turn of the motor
GEAR = 50.0
RATED_TORQUE = 1.0  # N·m of the motor; the load needs half of it
LOAD = 25.0  # N·m at the joint, of vertical.xml with the arm horizontal
BRAKE = 150.0  # likewise
STEP = 250e-6  # s, of the servo and of the simulation
MS = 1e-3  # s, the period of the scenarios
RAMP = 1000.0 / GEAR  # rad/s² at the joint: the servo's quick stop, 0x6085
LAG = 4e-3  # s: two time constants of the servo's velocity loop (80 Hz)
RESOLUTION = 1e-3  # rad: play of the position loop and of the dry friction at rest
NO_QUIRKS = ServoQuirks()
SERVO: dict[str, object] = {
    "counts_per_turn": COUNTS,
    "inertia": 1e-4,
    "viscous_friction": 1e-5,
    "coulomb_friction": 0.005,
    "rated_torque": RATED_TORQUE,
    "max_velocity": 500.0,
    "following_error_turns": 1.0,
}


class Sample(NamedTuple):
    """The rig at one moment, as MuJoCo and the drive have it."""

    joint: float  # rad
    velocity: float  # rad/s
    torque: float  # N·m of the drive at the joint
    powered: float  # 1: OPERATION ENABLED


class Kept(NamedTuple):
    """Result of a torque that was kept too long."""

    way: float  # rad, downwards
    velocity: float  # rad/s, downwards

    def ramp_bound(self, ramp: float = RAMP) -> float:
        """Return the way until the drive has slowed the arm down by `ramp` [rad/s²].

        The drive's velocity loop follows its ramp with a lag of two time constants.
        """
        return self.way + self.velocity**2 / (2 * ramp) + self.velocity * LAG


@dataclass
class VerticalCell:
    """The rig, scanned: a MainDevice on a segment of one servo that moves the arm."""

    segment: Segment
    link: FaultInjector
    main: cat.MainDevice
    plant: Plant
    servo: Servo | SercosDrive
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

    def fall_bound(self, reaction: float = 0.0, velocity: float = 0.0) -> float:
        """Return the bound of a fall [rad].

        It is v·t + ½·g_eff·t² plus the way on which the closed brake stops the arm. t is the sum of
        `reaction`, the brake's delay and two steps of the drive. From rest the brake's way is
        load / (brake - load) times the first one.

        Args:
            reaction: Time without torque while the drive is powered [s].
            velocity: Velocity downwards at the begin [rad/s].
        """
        seconds = reaction + self.brake_delay + 2 * STEP
        reached = velocity + self.g_eff * seconds
        braking = self.g_eff * (self.brake - LOAD) / LOAD
        return velocity * seconds + 0.5 * self.g_eff * seconds**2 + reached**2 / (2 * braking)

    def kept_torque(self, torque: float, seconds: float, velocity: float = 0.0) -> Kept:
        """Return the way downwards while a torque at the joint stays [N·m], and its end.

        Args:
            torque: Torque that is kept at the joint [N·m].
            seconds: Time for which it is kept [s].
            velocity: Velocity downwards at the begin [rad/s].
        """
        acceleration = self.g_eff * (LOAD - torque) / LOAD
        way = velocity * seconds + 0.5 * acceleration * seconds**2
        return Kept(max(way, 0.0), max(velocity + acceleration * seconds, 0.0))

    def let_pass(self, seconds: float) -> None:
        """Let time pass without a MainDevice."""
        self.link.wait_until(self.link.now() + round(seconds * 1e9), False)

    def sample(self) -> Sample:
        """Return the rig as it is now."""
        return Sample(self.joint, self.velocity, self.torque, float(self.powered))

    def compute(self, cycle: cat.Cycle, seconds: float) -> Trace:
        """Let the application compute without a commit, and return one sample per millisecond."""
        samples = []
        for _ in range(round(seconds / MS)):
            cycle.spend(MS)
            samples.append(self.sample())
        return Trace(samples)

    def drives(self, **options: object) -> cat.Drives:
        """Return the axis as an application declares it; `options` as of `cat.Drives`."""
        given = {"counts_per_turn": COUNTS, "gear_ratio": GEAR}
        if isinstance(self.servo, SercosDrive):
            given["rated_torque"] = RATED_TORQUE
        return cat.Drives(self.main.subs.drives, **{**given, **options})  # type: ignore[arg-type]


def until_taken(loop: cat.Loop, stream: Stream, rows: int) -> cat.Cycle:
    """Iterate until the stream has set as many rows of set-points, and return the cycle."""
    for cycle in loop:
        if stream.taken == rows:
            return cycle
    raise AssertionError("the loop ended")


class Trace:
    """Samples of the rig, one per millisecond, as arrays."""

    def __init__(self, samples: list[Sample]) -> None:
        columns = np.array(samples, float).T
        self.joint: npt.NDArray[np.float64] = columns[0]
        self.velocity: npt.NDArray[np.float64] = columns[1]
        self.torque: npt.NDArray[np.float64] = columns[2]
        self.powered: npt.NDArray[np.bool_] = columns[3] > 0

    def fall(self, before: float) -> float:
        """Return how far the arm was below the angle `before` at most [rad]."""
        return before - float(self.joint.min())

    @property
    def powered_ms(self) -> int:
        """Time until the drive left OPERATION ENABLED [ms]."""
        return len(self.powered) if self.powered.all() else int(self.powered.argmin())


def follow(
    cell: VerticalCell, arm: cat.Drives, loop: cat.Loop, cycles: int, velocity: float = 0.0
) -> cat.Cycle:
    """Write set-points for some cycles: hold in CST, move at `velocity` [rad/s] in CSP and CSV.

    Returns the cycle. Its set-points are written; the next one commits them.
    """
    last = 0
    for cycle in loop:
        arm.target.position[:] += velocity * MS
        arm.target.velocity[:] = velocity
        arm.target.torque[:] = cell.gravity
        last = last or cycle.number + cycles
        if cycle.number >= last:
            return cycle
    raise AssertionError("the loop ended")


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
    record: Path | None = None,
    sercos: bool = False,
    **servo: object,
) -> Iterator[VerticalCell]:
    """Set the rig up with the arm on its brake at `start` [rad], and scan it.

    Args:
        start: Angle of the arm [rad].
        quirks: How the drive differs from the profile.
        brake_delay: Time until the brake has closed [s].
        brake: Torque of the closed brake at the joint [N·m].
        record: File for all frames, see `frames.sent_to_axis`.
        sercos: True for a SERCOS drive, which has the default friction.
        servo: Options of `Servo`.
    """
    motor: Servo | SercosDrive
    if sercos:
        motor = SercosDrive(
            name="lift",
            resolution=COUNTS,
            inertia=1e-4,
            rated_torque=RATED_TORQUE,
            max_velocity=500,
        )
    else:
        motor = Servo(name="lift", quirks=quirks, **{**SERVO, **servo})  # type: ignore[arg-type]
    joint = Joint("shoulder", GEAR, start=start, brake=brake, brake_delay=brake_delay)
    plant = Plant(MODEL, [joint])
    segment = Segment([motor], plant=plant)
    link = FaultInjector(segment)
    with cat.MainDevice(link if record is None else Recorder(link, record)) as main:
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
