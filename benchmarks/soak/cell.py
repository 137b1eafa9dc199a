"""The machine of a soak test.

The loop requires an arm and lamps. A tool, a gripper and a sensor are optional.
"""

from __future__ import annotations

from random import Random

import numpy as np
import numpy.typing as npt

import catenary as cat
from benchmarks.soak.setting import Mode, Setting
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Crystal,
    Device,
    DigitalOutputs,
    Segment,
    Servo,
)

COUPLER, LAMPS, ARM, TOOL, GRIPPER, SENSOR = 0, 1, (2, 3), 4, 5, 6
DEVICES = 7
OPTIONAL = (TOOL, GRIPPER, SENSOR)
SERVOS = (*ARM, TOOL)
WITH_MAILBOX = (*SERVOS, SENSOR)
OUTPUTS = (LAMPS, GRIPPER)
COUNTS_PER_TURN = 2**20
PERIOD = 1e-3  # [s]
LATE_LIMIT, LATE_LIMIT_TORQUE = 0.05, 0.01  # [s] of the loop; the second in CST
AMPLITUDE, FREQUENCY = 0.2, 1.5  # [rad], [rad/s]: motion of the axes
VELOCITY_LIMIT = 2.0  # [rad/s]
ACCELERATION = 20.0  # [rad/s²], of fallback and return
TORQUE_LIMIT, TORQUE_SLOPE = 1.0, 100.0  # [N·m], [N·m/s]
INERTIA, FRICTION = 2e-3, 0.05  # [kg·m²], [N·m]
LOAD = 0.3  # [N·m] in CST; the motor carries it while it is powered
STIFFNESS, DAMPING = 1.25, 0.1  # [N·m/rad], [N·m·s/rad] in CST: 25 rad/s, critically damped
GAP = 5  # cycles; an axis that is disabled for longer restarts at its actual position
PPM, DRIFT_PPM, DRIFT_PERIOD, JITTER = 100.0, 2.0, 60.0, 0.5e-6  # of crystals; [s], [s]
POWERED = ("OPERATION ENABLED", "QUICK STOP ACTIVE", "FAULT REACTION ACTIVE")

Array = npt.NDArray[np.float64]


def make_segment(setting: Setting, random: Random) -> Segment:
    """Return the segment in virtual time; `random` draws its crystals."""
    devices: list[Device] = [
        Coupler(crystal=make_crystal(random, setting)),
        DigitalOutputs(bits=8),
        *(make_servo(f"arm {k}", k, random, setting) for k in (1, 2)),
        make_servo("tool", 3, random, setting),
        DigitalOutputs(serial=4),
        AnalogInputs(serial=5, crystal=make_crystal(random, setting)),
    ]
    return Segment(devices, ring=setting.is_ring)


def make_servo(name: str, serial: int, random: Random, setting: Setting) -> Servo:
    """Return a drive of this machine."""
    return Servo(
        name=name,
        serial=serial,
        inertia=INERTIA,
        coulomb_friction=FRICTION,
        crystal=make_crystal(random, setting),
    )


def make_crystal(random: Random, setting: Setting) -> Crystal:
    """Return a crystal with deviation, drift and jitter; an exact one without clocks."""
    if not setting.clocks:
        return Crystal()
    return Crystal(
        ppm=random.uniform(-PPM, PPM),
        drift_ppm=DRIFT_PPM,
        drift_period=DRIFT_PERIOD,
        jitter=JITTER,
    )


def apply_loads(segment: Segment) -> None:
    """Apply the load to each powered motor. A brake carries the load of the others."""
    for position in SERVOS:
        servo = segment[position]
        if isinstance(servo, Servo) and servo.state:
            servo.apply_load(-LOAD if servo.drive_state() in POWERED else 0.0)


class Part:
    """Owns the motion of some drives. Each oscillates from the position where it was enabled."""

    def __init__(self, drives: cat.Drives, mode: Mode) -> None:
        self.drives = drives
        self._mode = mode
        self._home: Array = np.zeros(len(drives))
        self._begin: Array = np.zeros(len(drives))  # [s] start of each oscillation
        self._away = np.full(len(drives), GAP + 1)  # cycles since each was enabled

    def step(self, time: float) -> None:
        """Write the targets of the cycle at `time` [s]. A late application keeps its phase."""
        actual, target = self.drives.actual, self.drives.target
        begins = self._away > GAP
        self._away = np.where(self.drives.enabled, 0, self._away + 1)
        place = target.position if self._mode == "csp" else actual.position
        self._home = np.where(begins, place, self._home)
        self._begin = np.where(begins, time, self._begin)
        phase = FREQUENCY * (time - self._begin)
        position = self._home + AMPLITUDE * (1 - np.cos(phase))
        velocity = AMPLITUDE * FREQUENCY * np.sin(phase)
        if self._mode == "csp":
            target.position[:] = position
        elif self._mode == "csv":
            target.velocity[:] = velocity
        else:
            error, slip = position - actual.position, velocity - actual.velocity
            target.torque[:] = LOAD + STIFFNESS * error + DAMPING * slip

    @property
    def idle(self) -> list[int]:
        """Axes that are present and not enabled."""
        return [int(k) for k in np.flatnonzero(self.drives.present & ~self.drives.enabled)]


class Requests:
    """Owns the process-data requests of one loop."""

    def __init__(self, main: cat.MainDevice, setting: Setting) -> None:
        subs = main.subs
        self.lamps = cat.Outputs(subs[LAMPS])
        self.gripper = cat.Outputs(subs[GRIPPER], required=False)
        self.sensor = cat.Inputs(subs[SENSOR], required=False)
        self.parts = {
            positions: Part(make_drives(main, positions, setting), setting.mode)
            for positions in (ARM, (TOOL,))
        }

    @property
    def all(self) -> tuple[cat.Drives | cat.Inputs | cat.Outputs, ...]:
        drives = [part.drives for part in self.parts.values()]
        return (*drives, self.lamps, self.gripper, self.sensor)

    def step(self, time: float) -> None:
        """Write the outputs of the application in every cycle."""
        for part in self.parts.values():
            part.step(time)
        self.lamps.bits[:] = 1
        self.gripper.bits[:] = 1

    @property
    def present(self) -> dict[int, bool]:
        """True for each device that answered in this cycle."""
        found = {LAMPS: self.lamps.present[0], GRIPPER: self.gripper.present[0]}
        found[SENSOR] = self.sensor.present[0]
        for positions, part in self.parts.items():
            found |= dict(zip(positions, map(bool, part.drives.present), strict=True))
        return found


def make_drives(main: cat.MainDevice, positions: tuple[int, ...], setting: Setting) -> cat.Drives:
    """Return the drives at these positions with the limits of this machine."""
    return cat.Drives(
        [main.subs[k] for k in positions],
        counts_per_turn=COUNTS_PER_TURN,
        mode=setting.mode,
        velocity_limit=VELOCITY_LIMIT,
        acceleration_limit=ACCELERATION,
        deceleration_limit=ACCELERATION,
        torque_limit=TORQUE_LIMIT,
        torque_slope=TORQUE_SLOPE if setting.mode == "cst" else None,
        required=not set(positions) <= set(OPTIONAL),
        dc=setting.clocks,
    )
