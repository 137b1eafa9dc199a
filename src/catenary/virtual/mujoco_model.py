"""MuJoCo model of a plant: reading MJCF and URDF, joints by name, and addresses of its arrays.

Only this module imports MuJoCo, and only when a plant is created.

Under load, MuJoCo's dry friction creeps. To make it stiff, the model uses `SOLIMP` and the shortest
time constant that the step allows. The arm of examples/cobot then creeps by 1e-6 rad/s on its
brakes.
"""

from __future__ import annotations

import ctypes
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from catenary.errors import ConfigurationError

if TYPE_CHECKING:
    import mujoco
    import numpy as np

ROOTS = ("mujoco", "robot")
SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
TIME_CONSTANT_STEPS, DAMPING_RATIO = 2.0, 1.0  # at least two steps, as MuJoCo's manual requires
DEEPEST = 1e-3  # maximum penetration of bodies at the start [m]


class Addresses(NamedTuple):
    """Addresses of a joint's values in qpos, qvel, qfrc_applied and dof_frictionloss."""

    q: int
    v: int
    force: int
    friction: int


def read_model(path: str | Path, *, step: float, contacts: bool) -> Model:
    """Read an MJCF or URDF file.

    Args:
        path: Path of the file.
        step: Time step of the simulation [s].
        contacts: False disables contacts and ignores the collision shapes of a URDF.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, or the model is invalid.
    """
    path = Path(path)
    mujoco = _mujoco(path)
    root = _root(path)
    try:
        if root.tag == "mujoco":
            model = mujoco.MjModel.from_xml_path(str(path))
        else:
            meshes = _remove_shapes(root, path) if contacts else _remove_shapes(root)
            model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"), meshes)
    except (ValueError, mujoco.FatalError) as error:
        raise ConfigurationError(f"{path}: MuJoCo rejects the model: {error}") from error
    model.opt.timestep = step
    flags = mujoco.mjtDisableBit
    # Only the virtual motors act on the joints, and a failed simulation must not reset itself.
    model.opt.disableflags |= flags.mjDSBL_ACTUATION | flags.mjDSBL_AUTORESET
    if not contacts:
        model.opt.disableflags |= flags.mjDSBL_CONTACT
    return Model(path, model)


def _mujoco(path: Path) -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise ConfigurationError(
            f"{path} cannot be simulated: MuJoCo is not installed",
            hint="pip install 'catenary[sim]'",
        ) from error
    return mujoco


def _root(path: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise ConfigurationError(f"cannot read the model {path}: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{path} is not valid XML: {error}") from error
    if root.tag not in ROOTS:
        raise ConfigurationError(
            f"{path}: <{root.tag}> is neither MJCF (<mujoco>) nor URDF (<robot>)",
            hint="expand the xacro file first: xacro robot.urdf.xacro > robot.urdf"
            if path.suffix == ".xacro"
            else "",
        )
    return root


def _remove_shapes(root: ElementTree.Element, path: Path | None = None) -> dict[str, bytes]:
    """Remove the visual shapes of a URDF. Without `path`, also remove the collision shapes.

    Returns:
        Contents of the remaining mesh files by name, searched from `path` upwards.
    """
    for link in root.iter("link"):
        for shape in [*link.iter("visual"), *([] if path else link.iter("collision"))]:
            link.remove(shape)
    meshes = [mesh.get("filename", "") for mesh in root.iter("mesh")] if path else []
    return {Path(name).name: _mesh(name, path).read_bytes() for name in meshes if path}


def _mesh(name: str, path: Path) -> Path:
    """Return the path of a mesh, relative to one of the folders above the URDF file.

    For a URI such as `package://name/meshes/x.stl`, leading folders of the name can be missing.

    Raises:
        ConfigurationError: The mesh does not exist.
    """
    below = name.removeprefix("package://").removeprefix("file://")
    parts = Path(below).parts
    for start in range(len(parts) if "://" in name else 1):
        for folder in path.resolve().parents:
            if (folder / Path(*parts[start:])).is_file():
                return folder / Path(*parts[start:])
    raise ConfigurationError(
        f"{path}: the mesh {name} does not exist",
        hint="correct the name, or pass contacts=False (in TOML: contacts = false), which does not "
        "need meshes",
    )


class Model:
    """MuJoCo model and its state."""

    def __init__(self, path: Path, model: mujoco.MjModel) -> None:
        import mujoco

        self._mujoco = mujoco
        self.path = path
        self.model = model
        self.data = mujoco.MjData(model)
        self._starts: dict[str, float] = {}

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
        for name, position in self._starts.items():
            self.data.qpos[self.model.jnt_qposadr[self._id(name)]] = position
        self._mujoco.mj_forward(self.model, self.data)

    def check_start(self) -> None:
        """Raise ConfigurationError if bodies overlap at the start and would repel each other."""
        self._start()
        for contact in self.data.contact:
            if contact.dist > -DEEPEST:
                continue
            one, other = (self._body(geom) for geom in (contact.geom1, contact.geom2))
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
    def model_address(self) -> int:
        return int(self.model._address)

    @property
    def data_address(self) -> int:
        return int(self.data._address)


def _address(numbers: np.ndarray, index: int) -> int:
    return int(numbers.ctypes.data) + index * numbers.itemsize
