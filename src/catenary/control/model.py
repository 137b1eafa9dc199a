"""Model of an arm, which MuJoCo (`pip install 'catenary[sim]'`) loads from a file."""

from __future__ import annotations

import ctypes
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from catenary.control.parts import PerAxis, checked
from catenary.errors import ConfigurationError

XACRO = "use an MJCF or URDF file; expand xacro first: xacro robot.urdf.xacro > robot.urdf"
SLIDE, HINGE = 2, 3  # mjtJoint


@dataclass(frozen=True, slots=True)
class Model:
    """Loaded model and the joints of the axes.

    `places` has, for each joint, the indices of its position and velocity in MuJoCo's vectors.
    """

    mujoco: Any
    native: Any
    joints: tuple[str, ...]
    places: tuple[tuple[int, int], ...]
    function: int  # address of mj_inverse

    def workspace(self) -> Any:
        """Return a new mjData with all joints at the initial positions of the model."""
        data = self.mujoco.MjData(self.native)
        self.mujoco.mj_inverse(self.native, data)
        return data


def load_model(
    path: Path,
    joints: Sequence[str] | None,
    axes: int | None,
    armature: PerAxis,
    *,
    fixed_links: bool = False,
) -> Model:
    """Load a model and select its joints.

    Contacts, joint limits and dry friction are disabled, and `armature` is added to the joints.

    Args:
        path: MJCF or URDF file.
        joints: names of the joints, in the order of the axes; None for all.
        axes: required number of joints; None for any.
        armature: inertia to add to each joint [kg·m²].
        fixed_links: True to keep the links of a URDF that no joint moves, such as a tool frame.
            Otherwise MuJoCo merges them with their parents.

    Raises:
        ConfigurationError: MuJoCo, the file or a joint is missing, the file is not a valid model,
            the joints do not match `axes`, or an axis cannot move a joint.
        ValueError: `armature` is negative or NaN, or has a wrong number of values.
    """
    mujoco = _mujoco()
    native = _native(mujoco, path, fixed_links)
    flags = mujoco.mjtDisableBit
    native.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
    chosen = _chosen(native, path, joints, axes)
    places = tuple((int(j.qposadr[0]), int(j.dofadr[0])) for j in map(native.joint, chosen))
    inertia = checked("armature", armature, len(chosen))
    for (_, degree), more in zip(places, inertia.tolist(), strict=True):
        native.dof_armature[degree] += more
    return Model(mujoco, native, chosen, places, _address(mujoco))


def _mujoco() -> Any:
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise ConfigurationError(
            "MuJoCo, which computes the dynamics of a model, is not installed",
            hint="pip install 'catenary[sim]'",
        ) from error


def _native(mujoco: Any, path: Path, fixed_links: bool) -> Any:
    """Return the mjModel of a file.

    The shapes of a URDF are removed, so that its mesh files need not exist. The dynamics depend
    only on masses and inertias.
    """
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{path} is not valid XML: {error}", hint=XACRO) from error
    try:
        if root.tag != "robot":
            return mujoco.MjModel.from_xml_path(str(path))
        for link in root.iter("link"):
            for shape in [*link.iter("visual"), *link.iter("collision")]:
                link.remove(shape)
        if fixed_links:
            _compiler(root).set("fusestatic", "false")
        return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))
    except ValueError as error:
        raise ConfigurationError(f"{path}: MuJoCo rejects it: {error}", hint=XACRO) from error


def _compiler(robot: ElementTree.Element) -> ElementTree.Element:
    """Return the element of a URDF with MuJoCo's compiler options, after adding it if missing."""
    own = robot.find("mujoco")
    if own is None:
        own = ElementTree.SubElement(robot, "mujoco")
    found = own.find("compiler")
    return ElementTree.SubElement(own, "compiler") if found is None else found


def _chosen(
    native: Any, path: Path, joints: Sequence[str] | None, axes: int | None
) -> tuple[str, ...]:
    existing = [native.joint(k).name for k in range(native.njnt)]
    chosen = tuple(existing if joints is None else joints)
    known = f"the model has the joints {', '.join(existing)}" if existing else "it has no joints"
    for name in chosen:
        if name not in existing:
            raise ConfigurationError(f"{path}: the model has no joint {name!r}", hint=known)
        if chosen.count(name) > 1:
            raise ConfigurationError(f"{path}: joint {name!r} is given twice", hint=known)
        kind = int(native.joint(name).type[0])
        if kind not in (SLIDE, HINGE):
            raise ConfigurationError(
                f"{path}: joint {name!r} is neither hinge nor slide, so a single axis cannot "
                "move it",
                hint=f"name the joints of the axes: joints=[...]; {known}",
            )
    if axes is not None and len(chosen) != axes:
        raise ConfigurationError(
            f"{path}: {len(chosen)} joints ({', '.join(chosen)}) for {axes} axes",
            hint=f"name one joint for each axis, in order: joints=[...]; {known}",
        )
    if not chosen:
        raise ConfigurationError(
            f"{path}: the model has no joints", hint="use a model with at least one joint"
        )
    return chosen


def _address(mujoco: Any) -> int:
    """Return the address of mj_inverse in the library that the Python module uses."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(folder.glob("libmujoco.so*")) + sorted(folder.glob("libmujoco*.dylib"))
    if not libraries:
        raise ConfigurationError(
            f"cannot find libmujoco in {folder}, next to the Python module of MuJoCo",
            hint="pip install --force-reinstall mujoco",
        )
    library = ctypes.CDLL(str(libraries[0]))
    return ctypes.cast(library.mj_inverse, ctypes.c_void_p).value or 0
