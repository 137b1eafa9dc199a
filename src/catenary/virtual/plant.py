"""Simulated mechanism: the motors of virtual servos drive the joints of one MuJoCo model.

    Segment(
        [Servo(axes=2, inertia=2e-5, rated_torque=0.6)],
        plant=Plant("arm.xml", [Joint("shoulder", gear=101), Joint("elbow", gear=50)]),
    )

The motors can be on several segments: each gets a part of the plant, `Plant.part`. The compiled
segments step the model (`plant_time.h`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from catenary.errors import ConfigurationError
from catenary.virtual._plant import CompiledPlant
from catenary.virtual._segment import Core
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.model_sensor import ModelSensor
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.motor_device import MotorDevice
from catenary.virtual.joint import Joint
from catenary.virtual.motor_pairs import pair_motors
from catenary.virtual.mujoco_model import Model
from catenary.virtual.plant_thread import PlantThread

if TYPE_CHECKING:
    import mujoco
    import numpy as np
    import numpy.typing as npt

# Equal to the internal cycle of the servos. A shorter step has no effect on their torques. A longer
# step adds dead time to their velocity loops (80 Hz).
STEP = 250e-6
SHORTEST_STEP, LONGEST_STEP = 20e-6, 1e-3
SECOND = 1e9
LOCKED = 1e5  # friction of a joint whose segment does not exist [N·m]


class Runner(Protocol):
    """Service of a segment, which the segments of a plant run together in real time."""

    def acquire(self) -> None: ...

    def release(self) -> None: ...


class Plant:
    """MuJoCo model whose joints are driven by the servos of one segment, or of several.

    Args:
        path: Path of an MJCF or URDF file.
        joints: Joints with motors, in the order of the axes on the line. None: all joints that are
            not passive, in the order of the model and without gears.
        passive: Names of the joints without a motor.
        step: Time step of the simulation [s].
        contacts: False lets bodies pass through each other.
        keyframe: Name of the keyframe of the model that is the initial state. The `start` of a
            joint has priority. None: the default state.
        held: Name of a body that is held in its initial pose until `release`. It can hang a robot
            with a free base until its drives are enabled. None: no body.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, the model is invalid, bodies overlap at
            the start, or the joints, the keyframe or the body do not match the model.
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
        keyframe: str | None = None,
        held: str | None = None,
    ) -> None:
        if not SHORTEST_STEP <= step <= LONGEST_STEP:
            raise ValueError(
                f"the step of a plant must be {SHORTEST_STEP:g} to {LONGEST_STEP:g} s, not {step};"
                " a longer step adds dead time to the velocity loops of the drives"
            )
        self.step = step
        self._model = Model(path, step=step, contacts=contacts, keyframe=keyframe, held=held)
        self.joints = self._select_joints(joints, passive)
        self._compiled = self._compile()
        self._pushes: dict[int, npt.NDArray[np.float64]] = {}  # newest of each body
        self._claimed: set[str] = set()  # joints of the segments
        self._cores: list[Core] = []
        self._services: list[Runner] = []
        self._thread = PlantThread(self._compiled, self.check)

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

    def _compile(self) -> CompiledPlant:
        """Return the compiled plant. Its joints are locked, because they have no motors yet."""
        model = self._model
        compiled = CompiledPlant(
            len(self.joints),
            step=model.function("mj_step"),
            set_handler=model.function("_mjPRIVATE_setTlsLogHandler"),
            model=model.model_address,
            data=model.data_address,
            period_ns=round(self.step * SECOND),
            keep=model,
        )
        for n, joint in enumerate(self.joints):
            model.stiffen_friction(joint.name)
            at, dry = model.addresses(joint.name), model.dry_friction(joint.name)
            compiled.make_joint(
                n, **at._asdict(), ratio=joint.ratio, zero=joint.zero, dry=dry, brake=LOCKED
            )
        return compiled

    @property
    def path(self) -> Path:
        return self._model.path

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo model. It includes the motors of the segments that have been created."""
        return self._model.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo state. Read it in virtual time only: in real time, a thread changes it."""
        return self._model.data

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors of the model."""
        return self._model.sensors

    def part(self, names: Sequence[str] | None = None) -> PlantPart:
        """Return some of the joints, for a segment: `Segment(devices, plant=plant.part(names))`.

        The segments of a plant are created before the first of them is opened, with the same
        clock: "monotonic", or the same `realtime.VirtualClock`. A joint whose segment does not
        exist is locked.

        Args:
            names: Names of the joints, in the order of the axes of the segment. None: all joints.
                An empty sequence is for a segment that has only sensors.

        Raises:
            ConfigurationError: A joint has no motor or is named twice, or `names` is a string.
        """
        if isinstance(names, str):
            raise ConfigurationError(
                f"names must be a sequence of names, not the string {names!r}; use [{names!r}]"
            )
        chosen = [joint.name for joint in self.joints] if names is None else list(names)
        places = {joint.name: n for n, joint in enumerate(self.joints)}
        for name in chosen:
            if name not in places or chosen.count(name) > 1:
                what = "is named twice" if name in places else "is not a joint with a motor"
                raise ConfigurationError(
                    f"{self.path.name}: {name!r} {what}; the joints are {', '.join(places)}"
                )
        joints = {places[name]: self.joints[places[name]] for name in chosen}
        return PlantPart(self, self._model, self._compiled, joints)

    def claim(self, core: Core, joints: Sequence[Joint]) -> None:
        """Reserve joints for a segment. Called by `PlantPart.attach`.

        Args:
            core: The compiled segment.
            joints: Joints that its servos drive.

        Raises:
            ValueError: A joint already belongs to a segment, the plant already moves, or the
                segments of the plant do not have the same clock.
        """
        name = self.path.name
        if any(joint.name in self._claimed for joint in joints):
            raise ValueError(
                f"{name} already belongs to another segment; make a new Plant, or give each segment"
                " its joints: Segment(..., plant=plant.part(names))"
            )
        if self.steps > 0 or self._thread.runs:
            raise ValueError(
                f"{name} already moves; create all its segments before the first one is opened"
            )
        kinds = {(each.is_virtual, each.shares_clock) for each in (*self._cores, core)}
        if self._cores and kinds not in ({(False, False)}, {(True, True)}):
            raise ValueError(
                f"the segments of {name} need one clock; pass the same VirtualClock to all of them,"
                ' or clock="monotonic"'
            )
        self._claimed.update(joint.name for joint in joints)
        self._cores.append(core)

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

    def release(self) -> None:
        """Release the body that is held, from the next step on. Any thread may call it.

        A no-op if the body was released before.

        Raises:
            ValueError: The plant was created without `held`.
        """
        if self._model.held is None:
            raise ValueError(f'{self.path.name}: no body is held; use Plant(..., held="pelvis")')
        self._compiled.free(self._model.holding_address)

    # -- time ----------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise ConfigurationError if the simulation has diverged or failed, and thus stopped."""
        compiled = self._compiled
        if compiled.apart:
            raise ConfigurationError(
                f"{self.path.name}: the segments of the plant have different clocks",
                hint="pass the same VirtualClock to all of them: Segment(..., clock=clock)",
            )
        if compiled.wild < 0 and not compiled.complaint:
            return
        what = [f"MuJoCo reports: {compiled.complaint}"] if compiled.complaint else []
        if compiled.wild >= 0:
            name = self.joints[compiled.wild].name
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
        return self._compiled.steps

    @property
    def services(self) -> list[Runner]:
        """Services of the segments. In real time, they run while one of the segments is open."""
        return self._services

    def start(self) -> None:
        """Start the thread that steps the plant in real time, without the GIL.

        Each call needs a call of `stop`. Only the first one starts the thread.
        """
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread after the last `stop`, and wait for its end. The plant then stands."""
        self._thread.stop()


class PlantPart:
    """Joints of a plant for the servos of one segment. `Plant.part` creates it.

    Args:
        plant: The plant.
        model: The model of the plant.
        compiled: The compiled plant.
        joints: The joints of the part by their number in the plant, in the order of the axes.
    """

    def __init__(
        self, plant: Plant, model: Model, compiled: CompiledPlant, joints: Mapping[int, Joint]
    ) -> None:
        self.plant = plant
        self._model = model
        self._compiled = compiled
        self._numbers = tuple(joints)
        self.joints = tuple(joints.values())
        self._wired: list[tuple[Device, int]] = []  # motor (servo, axis) of each joint
        self._inertias: list[float] = []  # initial inertia at each motor shaft

    def prepare(self, device: Device) -> None:
        """Tell a sensor the number of its values, before it is added to the segment.

        Raises:
            ConfigurationError: The model has no such sensor.
        """
        if isinstance(device, ModelSensor):
            device.measure({name: self._model.sensor(name).size for name in device.sensors})

    def attach(self, core: Core, devices: Sequence[Device]) -> None:
        """Connect the joints to the servos. Called by the segment when it is created.

        Args:
            core: The compiled segment.
            devices: The devices of the segment.

        Raises:
            ValueError: A joint already belongs to a segment, the plant already moves, or the
                segments of the plant do not have the same clock.
            ConfigurationError: The joints do not match the axes of the servos, or MuJoCo cannot
                simulate the model.
        """
        motors = pair_motors(self._model.path.name, self.joints, devices)
        self.plant.claim(core, self.joints)
        for joint, (servo, axis) in zip(self.joints, motors, strict=True):
            motor = servo.motors[axis]
            self._model.add_motor(
                joint.name,
                inertia=motor.inertia * joint.gear**2,
                viscous=motor.viscous_friction * joint.gear**2,
            )
        self._model.settle()
        self._inertias = [self._model.inertia(j.name) / j.gear**2 for j in self.joints]
        for n, (servo, axis) in enumerate(motors):
            self._make_joint(n, servo.motors[axis])
            self._connect_motor(n, servo, axis)
        self._wired = [*motors]
        for device in devices:
            self._connect_sensor(device)
        self._compiled.add_member(core)

    def _make_joint(self, n: int, motor: Motor) -> None:
        joint = self.joints[n]
        most = motor.rated_torque * motor.max_torque_ratio * joint.gear
        self._compiled.make_joint(
            self._numbers[n],
            **self._model.addresses(joint.name)._asdict(),
            ratio=joint.ratio,
            zero=joint.zero,
            dry=self._model.dry_friction(joint.name) + motor.coulomb_friction * joint.gear,
            brake=most if joint.brake is None else joint.brake,
            brake_delay_ns=round(joint.brake_delay * SECOND),
        )

    def _connect_motor(self, n: int, servo: MotorDevice, axis: int) -> None:
        """Connect a motor to joint `n`, and tune its loops for the inertia of the joint."""
        self._compiled.hang(self._numbers[n], servo.core, servo.position, axis)
        servo.tune(self._inertias[n], axis)

    def _connect_sensor(self, device: Device) -> None:
        if not isinstance(device, ModelSensor):
            return
        for slot, (name, offset, seed) in enumerate(device.values()):
            self._compiled.show(
                self._model.sensor(name).address + 8 * offset,
                device.core,
                device.position,
                slot,
                scale=device.scale.get(name, 1.0),
                bias=device.bias.get(name, 0.0),
                noise=device.noise.get(name, 0.0),
                seed=seed,
            )

    def replaced(self, old: Device, new: Device) -> None:
        """Connect the joints that `old` drove to the motors of `new`, or its sensors.

        Args:
            old: The device that was replaced.
            new: The device in its place.
        """
        for n, (device, axis) in enumerate(self._wired):
            if device is not old:
                continue
            self._wired[n] = new, axis
            if isinstance(new, MotorDevice) and axis < new.axes:
                self._connect_motor(n, new, axis)
        self._connect_sensor(new)
