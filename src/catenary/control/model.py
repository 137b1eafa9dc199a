"""An arm's model from a file, by MuJoCo (`pip install 'catenary[sim]'`): its joints checked against
the axes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from catenary.errors import ConfigurationError


@dataclass(frozen=True, slots=True)
class Model:
    """`places`: of each joint its position's and its velocity's place in MuJoCo's vectors."""

    mujoco: Any
    native: Any
    joints: tuple[str, ...]
    places: tuple[tuple[int, int], ...]
    function: int  # address of mj_inverse

    def workspace(self) -> Any:
        """A new mjData, all joints where the model has them."""
        data = self.mujoco.MjData(self.native)
        self.mujoco.mj_inverse(self.native, data)
        return data


def load_model(path: Path, joints: Sequence[str] | None, axes: int | None) -> Model:
    """ConfigurationError: MuJoCo is not there, or the file, or the joints."""
    mujoco = _mujoco()
    try:
        native = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:  # MuJoCo's word for a missing file and for a wrong one
        raise ConfigurationError(
            f"{path}: {str(error).strip()}", hint="an MJCF or URDF file, its meshes beside it"
        ) from error
    flags = mujoco.mjtDisableBit
    native.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
    chosen = _chosen(native, path, joints, axes)
    places = tuple((int(j.qposadr[0]), int(j.dofadr[0])) for j in map(native.joint, chosen))
    return Model(mujoco, native, chosen, places, _address(mujoco))


def _mujoco() -> Any:
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise ConfigurationError(
            "the dynamics of a model are computed by MuJoCo, which is not installed",
            hint="pip install 'catenary[sim]'",
        ) from error


def _chosen(
    native: Any, path: Path, joints: Sequence[str] | None, axes: int | None
) -> tuple[str, ...]:
    there = [native.joint(k).name for k in range(native.njnt)]
    chosen = tuple(there if joints is None else joints)
    known = f"it has {', '.join(there) or 'none'}"
    for name in chosen:
        if name not in there:
            raise ConfigurationError(f"{path}: no joint {name!r}", hint=known)
        if chosen.count(name) > 1:
            raise ConfigurationError(f"{path}: joint {name!r} is named twice", hint=known)
        kind = int(native.joint(name).type[0])
        if kind not in (SLIDE, HINGE):
            raise ConfigurationError(
                f"{path}: joint {name!r} is neither hinge nor slide: no single axis moves it",
                hint=f"name the joints of the axes, Dynamics(..., joints=[...]); {known}",
            )
    if axes is not None and len(chosen) != axes:
        raise ConfigurationError(
            f"{path}: {len(chosen)} joints ({', '.join(chosen)}) for {axes} axes",
            hint=f"name them in the order of the axes, Dynamics(..., joints=[...]); {known}",
        )
    if not chosen:
        raise ConfigurationError(f"{path}: no joints", hint="an arm has at least one")
    return chosen


SLIDE, HINGE = 2, 3  # mjtJoint


def _address(mujoco: Any) -> int:
    """Of mj_inverse, in the library that the Python module uses."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(folder.glob("libmujoco.so*")) + sorted(folder.glob("libmujoco*.dylib"))
    if not libraries:
        raise ConfigurationError(f"{folder}: no libmujoco beside MuJoCo's module")
    library = ctypes.CDLL(str(libraries[0]))
    return ctypes.cast(library.mj_inverse, ctypes.c_void_p).value or 0
