"""Simulated mechanism: the motors of virtual servos drive the joints of one MuJoCo model.

    Segment(
        [Servo(axes=2, inertia=2e-5, rated_torque=0.6)],
        plant=Plant("arm.xml", [Joint("shoulder", gear=101), Joint("elbow", gear=50)]),
    )

The compiled segment steps the model (`plant.h`). This module connects the motors to the joints.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
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
    import numpy as np
    import numpy.typing as npt

# Equal to the internal cycle of the servos. A shorter step has no effect on their torques. A longer
# step adds dead time to their velocity loops (80 Hz).
STEP = 250e-6
SHORTEST_STEP, LONGEST_STEP = 20e-6, 1e-3
SECOND = 1e9


class Joint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Joint of the model, and the motor that drives it.

    Motor angle [rad] = direction · gear · (joint position - zero).

    The brake closes `brake_delay` [s] after the drive removes the torque. It opens when the drive
    enters operation enabled. Without power it is closed.

    Attributes:
        name: Name of the joint in the model.
        gear: Gear ratio, motor angle per joint angle. For a slide joint, the unit is [rad/m].
        direction: 1 or -1.
        zero: Joint position at which the motor angle is 0 [rad or m].
        start: Initial position of the joint [rad or m]; None: the position in the model.
        brake: Holding torque of the brake at the joint [N·m]. 0: no brake. None: the maximum
            torque of the motor at the joint.
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
            raise ValueError(
                f"joint {self.name!r}: zero and start must be finite, "
                f"not {self.zero} and {self.start}"
            )
        if self.brake is not None and not 0 <= self.brake < math.inf:
            raise ValueError(f"joint {self.name!r}: brake must be at least 0 N·m, not {self.brake}")
        if not 0 <= self.brake_delay <= 10:
            raise ValueError(
                f"joint {self.name!r}: brake_delay must be 0 to 10 s, not {self.brake_delay}"
            )

    @property
    def ratio(self) -> float:
        return self.direction * self.gear


class Plant:
    """MuJoCo model whose joints are driven by the servos of one segment.

    Args:
        path: Path of an MJCF or URDF file.
        joints: Joints with motors, in the order of the axes on the line. None: all joints that are
            not passive, in the order of the model and without gears.
        passive: Names of the joints without a motor.
        step: Time step of the simulation [s].
        contacts: False lets bodies pass through each other.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, the model is invalid, bodies overlap at
            the start, or the joints do not match the model.
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
                f"the step of a plant must be {SHORTEST_STEP:g} to {LONGEST_STEP:g} s, not {step};"
                " a longer step adds dead time to the velocity loops of the drives"
            )
        self.step = step
        self._model = read_model(path, step=step, contacts=contacts)
        self.joints = self._select_joints(joints, passive)
        self._compiled: CompiledPlant | None = None
        self._wired: list[tuple[Device, int]] = []  # motor (servo, axis) of each joint
        self._pushes: dict[int, npt.NDArray[np.float64]] = {}  # newest of each body
        self._inertias: list[float] = []  # initial inertia at each motor shaft
        self._thread: threading.Thread | None = None

    def _select_joints(
        self, joints: Sequence[Joint] | None, passive: Sequence[str]
    ) -> tuple[Joint, ...]:
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
        """MuJoCo model. It includes the motors after the segment has been created."""
        return self._model.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo state. Read it in virtual time only: in real time, a thread changes it."""
        return self._model.data

    # -- motors and joints ---------------------------------------------------------------------

    def attach(self, core: Core, devices: Sequence[Device]) -> None:
        """Connect the joints to the servos. Called by the segment when it is created.

        Args:
            core: The compiled segment.
            devices: The devices of the segment.

        Raises:
            ValueError: The plant already belongs to a segment.
            ConfigurationError: The joints do not match the axes of the servos, or MuJoCo cannot
                simulate the model.
        """
        if self._compiled is not None:
            raise ValueError(
                f"{self.path.name} already belongs to another segment; make a new Plant"
            )
        motors = self._pair_motors(devices)
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
            self._connect_motor(compiled, n, servo, axis)
        self._wired = [*motors]
        self._compiled = compiled
        compiled.begin()

    def _pair_motors(self, devices: Sequence[Device]) -> list[tuple[Servo, int]]:
        """Return the (servo, axis) that drives each joint."""
        present = {
            (position, axis): device
            for position, device in enumerate(devices)
            if isinstance(device, Servo)
            for axis in range(device.axes)
        }
        rest = iter(sorted(present.keys() - {joint.axis for joint in self.joints}))
        places = [joint.axis or next(rest, None) for joint in self.joints]
        axes = ", ".join(f"({position}, {axis})" for position, axis in present) or "none"
        for joint, place in zip(self.joints, places, strict=True):
            if place is None or place not in present:
                missing = "axis" if place is None else f"axis {place}"
                raise ConfigurationError(
                    f"{self.path.name}: no {missing} for joint {joint.name!r}; the axes are {axes}"
                )
            if places.count(place) > 1:
                raise ConfigurationError(f"{self.path.name}: two joints use axis {place}")
        if any(rest) and not any(joint.axis for joint in self.joints):
            raise ConfigurationError(
                f"{self.path.name}: {len(self.joints)} joints have motors, but the segment has"
                f" {len(present)} axes",
                hint="if some axes do not drive the model, give each joint its"
                " axis=(position, axis)",
            )
        return [(present[place], place[1]) for place in places if place is not None]

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

    def _connect_motor(self, compiled: CompiledPlant, n: int, servo: Servo, axis: int) -> None:
        """Connect a motor to joint `n`, and tune its loops for the inertia of the joint."""
        compiled.hang(n, servo.position, axis)
        servo.tune(self._inertias[n], axis)

    def replaced(self, old: Device, new: Device) -> None:
        """Connect the joints that `old` drove to the motors of `new`.

        Args:
            old: The device that was replaced.
            new: The device in its place.
        """
        for n, (device, axis) in enumerate(self._wired):
            if device is not old:
                continue
            self._wired[n] = new, axis
            if isinstance(new, Servo) and axis < new.axes and self._compiled is not None:
                self._connect_motor(self._compiled, n, new, axis)

    # -- forces --------------------------------------------------------------------------------

    def push(self, body: str, force: Sequence[float], point: Sequence[float]) -> Callable[[], None]:
        """Apply a force to a body until the returned function is called, or until another push.

        Args:
            body: name of the body in the model.
            force: (3,) in the frame of the world [N].
            point: (3,) in the frame of the body [m]. The lever arm is that of the present pose.

        Raises:
            ValueError: The model has no such body.
        """
        import numpy as np  # only plants need NumPy, which MuJoCo installs

        number = self.body_number(body)
        data = self.data
        at = data.xpos[number] + data.xmat[number].reshape(3, 3) @ np.asarray(point, np.float64)
        wrench = np.array([*force, *np.cross(at - data.xipos[number], force)])
        self._pushes[number] = wrench
        data.xfrc_applied[number] = wrench

        def end() -> None:
            if self._pushes.get(number) is wrench:
                data.xfrc_applied[number] = 0.0

        return end

    def body_number(self, name: str) -> int:
        """Return the number of a body in the model. Raises ValueError if there is none."""
        names = [self.model.body(n).name for n in range(self.model.nbody)]
        if name not in names[1:]:
            raise ValueError(
                f"{self.path.name} has no body {name!r}; its bodies are {', '.join(names[1:])}"
            )
        return names.index(name)

    # -- time ----------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise ConfigurationError if the simulation has diverged or failed, and thus stopped."""
        if self._compiled is None or (self._compiled.wild < 0 and not self._compiled.complaint):
            return
        what = [f"MuJoCo reports: {self._compiled.complaint}"] if self._compiled.complaint else []
        if self._compiled.wild >= 0:
            name = self.joints[self._compiled.wild].name
            what.insert(0, f"joint {name!r} exceeded 1e6 rad/s at its motor")
        raise ConfigurationError(
            f"{self.path.name}: the simulation stopped after {self.data.time:.4f} s:"
            f" {'; '.join(what)}",
            hint="check the model for masses and inertias near zero, overlapping bodies, a step"
            f" that is too long (now {self.step:g} s), and insufficient memory (MJCF: <size"
            " memory>)",
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
        self.check()  # the thread prints this error and ends; frames are still answered

    def stop(self) -> None:
        """Stop the thread and wait for its end. The plant does not move until `start`."""
        if self._compiled is not None and self._thread is not None:
            self._compiled.end()
            self._thread.join()
            self._thread = None
