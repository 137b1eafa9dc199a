"""The two networks of the humanoid: its drives and sensors, and their virtual devices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import body
import laws
import numpy as np
from exchange import FEET
from status import Status

import catenary as cat
from catenary import control, virtual

COUNTS = 2**20  # encoder counts per turn of a motor
NOISE = {  # standard deviation of each sensor of humanoid.xml: [1], [rad/s], [m/s²], [N], [N·m]
    "imu_orientation": 5e-4,
    "imu_gyro": 5e-3,
    "imu_acceleration": 2e-2,
    "foot_force": 3.0,
    "foot_torque": 0.1,
}
IMU, FOOT = tuple(NOISE)[:3], tuple(NOISE)[3:]
BRAKE = 0.5  # damping of the damping mode, divided by that of the command
SOFT = 0.2  # damping of a joint without stiffness, divided by its damping
NAMES = "upper", "lower"
PARTS = body.UPPER, body.LOWER
ROWS = slice(0, len(body.UPPER)), slice(len(body.UPPER), len(body.JOINTS))


def devices(joints: Sequence[body.Joint]) -> list[virtual.Servo]:
    """Return a virtual servo for each joint."""
    return [
        virtual.Servo(
            name=joint.name,
            serial=number,
            counts_per_turn=COUNTS,
            inertia=joint.motor.inertia,
            viscous_friction=joint.motor.viscous_friction,
            coulomb_friction=joint.motor.coulomb_friction,
            rated_torque=joint.motor.rated_torque,
            max_torque_ratio=body.PEAK_RATIO,
            max_velocity=joint.motor.max_velocity,
        )
        for number, joint in enumerate(joints, start=1)
    ]


def sensors() -> list[virtual.ModelSensor]:
    """Return the virtual sensors of the lower network: IMU, left foot, right foot."""
    feet = [
        virtual.ModelSensor(
            sensors=[f"{side}_{each}" for each in FOOT],
            noise={f"{side}_{each}": NOISE[each] for each in FOOT},
            seed=number,
            name=f"{side} foot",
        )
        for number, side in enumerate(body.SIDES)
    ]
    imu = virtual.ModelSensor(sensors=IMU, noise={each: NOISE[each] for each in IMU}, name="IMU")
    return [imu, *feet]


def make_plant(path: str) -> virtual.Plant:
    """Return the simulated body, which hangs in its gantry.

    Raises:
        ConfigurationError: The model has other joints, or lacks some.
    """
    joints = [virtual.Joint(joint.name, gear=joint.motor.gear) for joint in body.JOINTS]
    return virtual.Plant(path, joints, keyframe="stand", held="pelvis")


def segments(plant: virtual.Plant, clock: object) -> list[cat.Segment]:
    """Return the virtual segments of both networks, each a ring, with one body.

    Args:
        plant: The body.
        clock: "monotonic", or a clock that both segments share.
    """
    return [
        cat.Segment(
            [*devices(joints), *more],
            plant=plant.part([joint.name for joint in joints]),
            clock=clock,
            ring=True,
        )
        for joints, more in zip(PARTS, ([], sensors()), strict=True)
    ]


class Network:
    """Drives of one network, and the parameters of its law.

    Args:
        main: MainDevice of the network.
        number: number of the network in the loop.
        silence: age of a command at which the law brakes [s].
    """

    def __init__(self, main: cat.MainDevice, number: int, silence: float) -> None:
        self.main, self.number, self.rows = main, number, ROWS[number]
        joints, rows = PARTS[number], self.rows
        self.drives = cat.Drives(
            main.scan().drives,
            names=[joint.name for joint in joints],
            mode="cst",
            counts_per_turn=COUNTS,
            gear_ratio=[joint.motor.gear for joint in joints],
            velocity_limit=[joint.motor.max_velocity / joint.motor.gear for joint in joints],
            torque_limit=body.TORQUE[rows].tolist(),
            required=False,
        )
        self._gains = body.STIFFNESS[rows], body.DAMPING[rows]
        self._command = laws.Command(
            make_limits(joints, rows, silence), make_friction(joints, rows)
        )
        self._run: cat.LawRun | None = None
        self.status = Status(main, NAMES[number])

    def start(self, loop: cat.Loop) -> None:
        """Start the law."""
        memory = np.zeros(laws.STATES)
        self._run = loop.start(laws.joints, memory, self._command.parameters, network=self.number)

    def write(self, sign: int, mode: float, command: np.ndarray) -> None:
        """Send a `COMMAND` to the law. `sign` differs from that before."""
        names = ("position", "velocity", "torque", "scale")
        goal, speed, torque, scale = (command[name][self.rows] for name in names)
        stiffness, damping = self._gains
        gains = stiffness * scale, damping * (SOFT + (1 - SOFT) * scale)
        self._run.parameters = self._command.write(sign, mode, goal, speed, torque, gains)

    @property
    def works(self) -> bool:
        """True if all drives answer and none is in fault."""
        return bool(self.drives.present.all()) and not self.drives.faults


def make_limits(joints: Sequence[body.Joint], rows: slice, silence: float) -> laws.Limits:
    speed = [joint.motor.max_velocity / joint.motor.gear for joint in joints]
    return laws.Limits(
        torque=body.TORQUE[rows],
        lower=body.LOW[rows],
        upper=body.HIGH[rows],
        speed=0.95 * np.array(speed),  # below the limit of the drive
        brake=BRAKE * body.DAMPING[rows],
        silence=silence,
    )


def make_friction(joints: Sequence[body.Joint], rows: slice) -> control.Friction:
    return control.Friction(len(joints), body.VISCOUS[rows], body.COULOMB[rows])


@dataclass(frozen=True)
class Sensors:
    """IMU and force/torque sensors at the end of the lower network."""

    imu: cat.Inputs
    feet: tuple[cat.Inputs, ...]

    @classmethod
    def of(cls, main: cat.MainDevice) -> Sensors:
        """Return the requests for the last three devices. The loop continues without them."""
        imu, *feet = (cat.Inputs(sub, required=False) for sub in list(main.subs)[-1 - FEET :])
        return cls(imu, tuple(feet))

    @property
    def requests(self) -> tuple[cat.Inputs, ...]:
        return self.imu, *self.feet

    def write(self, state: np.ndarray) -> None:
        """Write the values into a `STATE`."""
        values = self.imu.reals
        state["orientation"], state["gyro"], state["acceleration"] = (
            values[:4],
            values[4:7],
            values[7:10],
        )
        state["imu_valid"] = self.imu.present[0]
        for number, foot in enumerate(self.feet):
            state["feet"][number] = foot.reals
            state["feet_valid"][number] = foot.present[0]
