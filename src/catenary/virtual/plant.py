"""A simulated arm behind virtual servos: their motors turn the joints of one MuJoCo model.

    Segment(
        [Servo(axes=2, inertia=2e-5, rated_torque=0.6)],
        plant=Plant("arm.xml", [Joint("shoulder", gear=101), Joint("elbow", gear=50)]),
    )

The compiled segment steps the model (`plant.h`). This module connects motors and joints.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import msgspec

from catenary.errors import ConfigurationError
from catenary.virtual._plant import CompiledPlant
from catenary.virtual._segment import Core
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.servo import Servo
from catenary.virtual.mujoco_model import read_model

if TYPE_CHECKING:
    import mujoco

# The servos' own cycle: their torques change this often. A shorter step adds nothing that they
# could measure. A longer step is a dead time in their velocity loops (80 Hz).
STEP = 250e-6
SHORTEST_STEP, LONGEST_STEP = 20e-6, 1e-3
SECOND = 1e9


class Joint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A joint of the model and the motor that drives it.

    Motor angle = direction · gear · (joint angle - zero) [rad]. For a slide, `gear` is [rad/m] and
    motor angle = direction · gear · (position - zero).

    The brake closes `brake_delay` [s] after the drive's torque ends. It opens when the drive enters
    operation enabled, and it is closed without power.

    Attributes:
        name: Name of the joint in the model.
        gear: Gear ratio, motor angle per joint angle (slide: [rad/m]).
        direction: 1 or -1.
        zero: Joint position at which the motor angle is 0 [rad or m].
        start: Initial position of the joint [rad or m]; None: that of the model.
        brake: Holding torque at the joint [N·m]; None: the motor's maximum, 0: no brake.
        brake_delay: Closing time of the brake [s].
        axis: (position of the servo, axis number); None: the next axis on the line.
    """

    name: str
    gear: float = 1.0
    direction: Literal[1, -1] = 1
    zero: float = 0.0
    start: float | None = None
    brake: float | None = None
    brake_delay: float = 0.0
    axis: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.gear < math.inf:
            raise ValueError(f"joint {self.name!r}: gear must be positive, not {self.gear}")
        if self.direction not in (1, -1):
            raise ValueError(
                f"joint {self.name!r}: direction must be 1 or -1, not {self.direction}"
            )
        if not math.isfinite(self.zero) or not math.isfinite(self.start or 0.0):
            raise ValueError(f"joint {self.name!r}: zero and start must be finite numbers")
        if self.brake is not None and not 0 <= self.brake < math.inf:
            raise ValueError(f"joint {self.name!r}: brake must be 0 or more N·m, not {self.brake}")
        if not 0 <= self.brake_delay <= 10:
            raise ValueError(f"joint {self.name!r}: brake_delay must be 0 to 10 s")

    @property
    def ratio(self) -> float:
        return self.direction * self.gear


class Plant:
    """Owns a MuJoCo model with joints that the servos of one segment drive.

    Args:
        path: An MJCF or URDF file.
        joints: The joints with motors, in the order of the axes on the line. None: all joints of
            the model, in its order, without gears.
        passive: Names of the joints without a motor.
        step: Time step of the simulation [s].
        contacts: False lets bodies pass through each other.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, the model is invalid or starts in
            contact, or the joints do not match the model. The message lists the joints of the
            model.
        ValueError: The step is out of range.
    """

    def __init__(
        self,
        path: str | Path,
        joints: Sequence[Joint] | None = None,
        *,
        passive: Sequence[str] = (),
        step: float = STEP,
        contacts: bool = True,
    ) -> None:
        if not SHORTEST_STEP <= step <= LONGEST_STEP:
            raise ValueError(
                f"a plant's step must be {SHORTEST_STEP:g} to {LONGEST_STEP:g} s, not {step}:"
                " a longer step is a dead time in the drives' velocity loops"
            )
        self.step = step
        self._model = read_model(path, step=step, contacts=contacts)
        self.joints = self._chosen(joints, passive)
        self._compiled: CompiledPlant | None = None
        self._wired: list[tuple[Device, int]] = []  # motor (servo, axis) of each joint
        self._inertias: list[float] = []  # initial inertia at each motor shaft
        self._thread: threading.Thread | None = None

    def _chosen(self, joints: Sequence[Joint] | None, passive: Sequence[str]) -> tuple[Joint, ...]:
        if joints is None:
            joints = [Joint(name) for name in self._model.joints if name not in passive]
        self._model.check_joints([joint.name for joint in joints], passive)
        for joint in joints:
            if joint.start is not None:
                self._model.place(joint.name, joint.start)
        self._model.check_start()
        return tuple(joints)

    @property
    def path(self) -> Path:
        return self._model.path

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model. It contains the motors once the segment is made."""
        return self._model.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's state. Read it in virtual time only; in real time a thread changes it."""
        return self._model.data

    # -- motors and joints ---------------------------------------------------------------------

    def attach(self, core: Core, devices: Sequence[Device]) -> None:
        """Connect the joints to the servos. The segment calls this when it is made."""
        if self._compiled is not None:
            raise ValueError(
                f"{self.path.name} already belongs to another segment; make a new Plant"
            )
        motors = self._paired(devices)
        for joint, (servo, _axis) in zip(self.joints, motors, strict=True):
            self._model.add_motor(
                joint.name,
                inertia=servo.inertia * joint.gear**2,
                viscous=servo.viscous_friction * joint.gear**2,
            )
        self._model.settle()
        self._inertias = [self._model.inertia(j.name) / j.gear**2 for j in self.joints]
        compiled = CompiledPlant(
            core,
            len(self.joints),
            step=self._model.function("mj_step"),
            set_handler=self._model.function("_mjPRIVATE_setTlsLogHandler"),
            model=self._model.model_address,
            data=self._model.data_address,
            period_ns=round(self.step * SECOND),
            keep=self._model,
        )
        for n, (servo, axis) in enumerate(motors):
            self._make_joint(compiled, n, servo)
            self._hang(compiled, n, servo, axis)
        self._wired = [*motors]
        self._compiled = compiled
        compiled.begin()

    def _paired(self, devices: Sequence[Device]) -> list[tuple[Servo, int]]:
        """Return the (servo, axis) of each joint."""
        there = {
            (position, axis): device
            for position, device in enumerate(devices)
            if isinstance(device, Servo)
            for axis in range(device.axes)
        }
        rest = iter(sorted(there.keys() - {joint.axis for joint in self.joints}))
        places = [joint.axis or next(rest, None) for joint in self.joints]
        axes = ", ".join(f"({position}, {axis})" for position, axis in there) or "none"
        for joint, place in zip(self.joints, places, strict=True):
            if place is None or place not in there:
                asked = "axis" if place is None else f"axis {place}"
                raise ConfigurationError(
                    f"{self.path.name}: no {asked} for joint {joint.name!r}; the axes are {axes}"
                )
            if places.count(place) > 1:
                raise ConfigurationError(f"{self.path.name}: two joints use the axis {place}")
        if any(rest) and not any(joint.axis for joint in self.joints):
            raise ConfigurationError(
                f"{self.path.name}: {len(self.joints)} joints have motors, but the segment has"
                f" {len(there)} axes",
                hint="if some axes do not drive the model, give each joint its"
                " axis=(position, axis)",
            )
        return [(there[place], place[1]) for place in places if place is not None]

    def _make_joint(self, compiled: CompiledPlant, n: int, servo: Servo) -> None:
        joint = self.joints[n]
        most = servo.rated_torque * servo.max_torque_ratio * joint.gear
        at = self._model.addresses(joint.name)
        compiled.make_joint(
            n,
            q=at.q,
            v=at.v,
            force=at.force,
            friction=at.friction,
            ratio=joint.ratio,
            zero=joint.zero,
            dry=self._model.dry_friction(joint.name) + servo.coulomb_friction * joint.gear,
            brake=most if joint.brake is None else joint.brake,
            brake_delay_ns=round(joint.brake_delay * SECOND),
        )

    def _hang(self, compiled: CompiledPlant, n: int, servo: Servo, axis: int) -> None:
        """Connect a motor to joint `n` and tune its loops for the joint's inertia."""
        compiled.hang(n, servo.position, axis)
        servo.tune(self._inertias[n], axis)

    def replaced(self, old: Device, new: Device) -> None:
        """Connect the motors of a replaced device to the new one."""
        for n, (device, axis) in enumerate(self._wired):
            if device is not old:
                continue
            self._wired[n] = new, axis
            if isinstance(new, Servo) and axis < new.axes and self._compiled is not None:
                self._hang(self._compiled, n, new, axis)

    # -- time ----------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise ConfigurationError if the simulation diverged and therefore stopped."""
        if self._compiled is None or (self._compiled.wild < 0 and not self._compiled.complaint):
            return
        what = [f"MuJoCo reports: {self._compiled.complaint}"] if self._compiled.complaint else []
        if self._compiled.wild >= 0:
            name = self.joints[self._compiled.wild].name
            what.insert(0, f"joint {name!r} exceeded all bounds")
        raise ConfigurationError(
            f"{self.path.name}: the simulation stopped after {self.data.time:.4f} s:"
            f" {'; '.join(what)}",
            hint="check for masses and inertias near zero, overlapping bodies, a step (now"
            f" {self.step:g} s) that is too long, and too little memory (MJCF: <size memory>)",
        )

    @property
    def steps(self) -> int:
        """Number of steps simulated so far."""
        return 0 if self._compiled is None else self._compiled.steps

    def start(self) -> None:
        """Start the thread that steps the plant in real time, without the GIL."""
        if self._compiled is not None:
            self._thread = threading.Thread(
                target=self._run, args=(self._compiled,), name="virtual-plant", daemon=True
            )
            self._thread.start()

    def _run(self, compiled: CompiledPlant) -> None:
        compiled.run()
        self.check()  # the thread prints this error; frames are still answered

    def stop(self) -> None:
        """Stop the thread. The plant stands still until `start`."""
        if self._compiled is not None and self._thread is not None:
            self._compiled.end()
            self._thread.join()
            self._thread = None
