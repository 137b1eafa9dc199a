"""MuJoCo model of a plant: joints and sensors by name, and addresses of its arrays.

Under load, MuJoCo's dry friction creeps. To make it stiff, the model uses `SOLIMP` and the shortest
time constant that the step allows. The arm of examples/cobot then creeps by 1e-6 rad/s on its
brakes. The constraint that holds a body is equally stiff.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from catenary.errors import ConfigurationError
from catenary.virtual.mujoco_file import HELD, import_mujoco, read_model

if TYPE_CHECKING:
    import numpy as np

SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
TIME_CONSTANT_STEPS, DAMPING_RATIO = 2.0, 1.0  # at least two steps, as MuJoCo's manual requires
HOLDING_TIME_CONSTANT = 0.01  # of the constraint that holds a body [s]
DEEPEST = 1e-3  # maximum penetration of bodies at the start [m]
DEEPEST_IN_GROUND = 3e-3  # the same with the world, where the load compresses soft contacts [m]


class Addresses(NamedTuple):
    """Addresses of a joint's values in qpos, qvel, qfrc_applied and dof_frictionloss."""

    q: int
    v: int
    force: int
    friction: int


class Sensor(NamedTuple):
    """Sensor of the model: number of its values, and the address of the first in sensordata."""

    size: int
    address: int


class Model:
    """MuJoCo model and its state.

    Args:
        path: Path of an MJCF or URDF file.
        step: Time step of the simulation [s].
        contacts: False lets bodies pass through each other.
        keyframe: Name of the keyframe that is the initial state; None: the default state.
        held: Name of a body that is held in its initial pose; None: no body.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, the model is invalid, or it does not have
            the keyframe or the body.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        step: float,
        contacts: bool,
        keyframe: str | None = None,
        held: str | None = None,
    ) -> None:
        self.path = Path(path)
        self.model = read_model(path, step=step, contacts=contacts, held=held)
        self._mujoco = import_mujoco(self.path)
        self.data = self._mujoco.MjData(self.model)
        self._keyframe = None if keyframe is None else self._keyframe_number(keyframe)
        self.held = held
        self._starts: dict[str, float] = {}

    def _keyframe_number(self, name: str) -> int:
        names = [self.model.key(n).name for n in range(self.model.nkey)]
        if name not in names:
            raise ConfigurationError(
                f"{self.path} has no keyframe {name!r}; its keyframes are"
                f" {', '.join(names) or 'none'}"
            )
        return names.index(name)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that a motor can drive (hinges and slides)."""
        kinds = self._mujoco.mjtJoint
        turnable = int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)
        return tuple(
            self.model.joint(n).name
            for n in range(self.model.njnt)
            if int(self.model.jnt_type[n]) in turnable
        )

    def check_joints(self, turned: Sequence[str], passive: Sequence[str]) -> None:
        """Check that every joint either has one motor or is passive.

        Args:
            turned: Names of the joints with a motor.
            passive: Names of the joints without a motor.

        Raises:
            ConfigurationError: A name is unknown, used twice or missing. The message lists the
                joints.
        """
        there = f"its joints are {', '.join(self.joints) or 'none'}"
        for name in [*turned, *passive]:
            if name not in self.joints:
                raise ConfigurationError(f"{self.path} has no joint {name!r}; {there}")
            if [*turned, *passive].count(name) > 1:
                raise ConfigurationError(f"{self.path}: joint {name!r} is used twice; {there}")
        left = [name for name in self.joints if name not in turned and name not in passive]
        if left:
            raise ConfigurationError(
                f"{self.path}: {', '.join(map(repr, left))} has no motor; {there}",
                hint=f"add a Joint for each of them, or pass passive={left!r}",
            )

    def _id(self, name: str) -> int:
        return int(self.model.joint(name).id)

    def _dof(self, name: str) -> int:
        return int(self.model.jnt_dofadr[self._id(name)])

    def place(self, name: str, position: float) -> None:
        """Set the initial position of a joint.

        Args:
            name: Name of the joint.
            position: Initial position [rad or m].

        Raises:
            ConfigurationError: The position is outside of the range of the joint.
        """
        low, high = self.model.jnt_range[self._id(name)].tolist()
        if self.model.jnt_limited[self._id(name)] and not low <= position <= high:
            raise ConfigurationError(
                f"{self.path}: joint {name!r} cannot start at {position:g}; its range is {low:g} to"
                f" {high:g}"
            )
        self._starts[name] = position

    def _start(self) -> None:
        self._mujoco.mj_resetData(self.model, self.data)
        if self._keyframe is not None:
            self._mujoco.mj_resetDataKeyframe(self.model, self.data, self._keyframe)
            self.data.time = 0.0
        for name, position in self._starts.items():
            self.data.qpos[self.model.jnt_qposadr[self._id(name)]] = position
        if self.held is not None:
            self._hold(self.held)
        self._mujoco.mj_forward(self.model, self.data)

    def _hold(self, body: str) -> None:
        """Let the constraint hold the body in its present pose."""
        self._mujoco.mj_kinematics(self.model, self.data)
        number, pose = self.model.equality(HELD).id, self.data.body(body)
        # Anchor in the body, pose in the world, and weight of the rotation (MuJoCo, eq_data).
        self.model.eq_data[number, :11] = [0, 0, 0, *pose.xpos, *pose.xquat, 1]
        self.model.eq_solref[number] = HOLDING_TIME_CONSTANT, DAMPING_RATIO
        self.model.eq_solimp[number] = SOLIMP

    def check_start(self) -> None:
        """Raise ConfigurationError if bodies overlap at the start and would repel each other."""
        self._start()
        for contact in self.data.contact:
            geoms = contact.geom1, contact.geom2
            in_ground = any(self.model.geom_bodyid[geom] == 0 for geom in geoms)
            if contact.dist > -(DEEPEST_IN_GROUND if in_ground else DEEPEST):
                continue
            one, other = map(self._body, geoms)
            raise ConfigurationError(
                f"{self.path}: {one} and {other} overlap by {-1e3 * contact.dist:.1f} mm at the"
                " start; their contact would block or overload the joints",
                hint="exclude the pair (MJCF: <contact><exclude body1=... body2=.../></contact>),"
                " use another start position, or pass contacts=False",
            )

    def _body(self, geom: int) -> str:
        return f"body {self.model.body(self.model.geom_bodyid[geom]).name!r}"

    def add_motor(self, name: str, *, inertia: float, viscous: float) -> None:
        """Add the inertia and viscous friction of a motor to a joint.

        Also make the dry friction of the joint stiff.

        Args:
            name: Name of the joint.
            inertia: Inertia at the joint [kg·m²].
            viscous: Viscous friction at the joint [N·m·s/rad].
        """
        dof = self._dof(name)
        self.model.dof_armature[dof] += inertia
        self.model.dof_damping[dof] += viscous
        self.stiffen_friction(name)

    def stiffen_friction(self, name: str) -> None:
        """Make the dry friction of a joint stiff."""
        dof = self._dof(name)
        time_constant = TIME_CONSTANT_STEPS * self.model.opt.timestep
        self.model.dof_solref[dof] = time_constant, DAMPING_RATIO
        self.model.dof_solimp[dof] = SOLIMP

    def settle(self) -> None:
        """Recompute the derived values after all motors were added, and reset to the start.

        Raises:
            ConfigurationError: MuJoCo cannot simulate one step of the model.
        """
        self._mujoco.mj_setConst(self.model, self.data)
        self._start()
        try:
            self._mujoco.mj_step(self.model, self.data)  # raises, unlike in compiled code
        except self._mujoco.FatalError as error:
            raise ConfigurationError(
                f"{self.path}: MuJoCo cannot simulate the model: {error}"
            ) from error
        self._start()

    def inertia(self, name: str) -> float:
        """Return the inertia at the joint in the start position, including the motor [kg·m²]."""
        dof = self._dof(name)
        import numpy as np  # only plants need NumPy, which MuJoCo installs

        dense = np.zeros((self.model.nv, self.model.nv))
        self._mujoco.mj_fullM(self.model, self.data, dense)
        return float(dense[dof, dof])

    def dry_friction(self, name: str) -> float:
        """Return the dry friction that the model specifies for the joint [N·m]."""
        return float(self.model.dof_frictionloss[self._dof(name)])

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self.model.sensor(n).name for n in range(self.model.nsensor))

    def sensor(self, name: str) -> Sensor:
        """Return a sensor by name. Raises ConfigurationError if there is none."""
        if not name or name not in self.sensors:
            raise ConfigurationError(
                f"{self.path} has no sensor {name!r}; its sensors are"
                f" {', '.join(self.sensors) or 'none'}"
            )
        number = self.sensors.index(name)
        first = int(self.model.sensor_adr[number])
        return Sensor(int(self.model.sensor_dim[number]), _address(self.data.sensordata, first))

    # -- for compiled code ---------------------------------------------------------------------

    def addresses(self, name: str) -> Addresses:
        dof = self._dof(name)
        return Addresses(
            q=_address(self.data.qpos, int(self.model.jnt_qposadr[self._id(name)])),
            v=_address(self.data.qvel, dof),
            force=_address(self.data.qfrc_applied, dof),
            friction=_address(self.model.dof_frictionloss, dof),
        )

    def function(self, name: str) -> int:
        """Return the address of a function in the MuJoCo library; 0 if it does not exist."""
        [library] = Path(str(self._mujoco.__file__)).parent.glob("libmujoco.so*")
        function = getattr(ctypes.CDLL(str(library)), name, None)
        return 0 if function is None else ctypes.cast(function, ctypes.c_void_p).value or 0

    @property
    def holding_address(self) -> int:
        """Address of the value in eq_active that holds a body."""
        return _address(self.data.eq_active, int(self.model.equality(HELD).id))

    @property
    def model_address(self) -> int:
        return int(self.model._address)

    @property
    def data_address(self) -> int:
        return int(self.data._address)


def _address(numbers: np.ndarray, index: int) -> int:
    return int(numbers.ctypes.data) + index * numbers.itemsize
