"""Reading of MJCF and URDF files for a plant.

MuJoCo is imported only when a plant is created.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catenary.errors import ConfigurationError

if TYPE_CHECKING:
    import mujoco

ROOTS = ("mujoco", "robot")
HELD = "held by Catenary"  # name of the constraint that holds a body


def read_model(
    path: str | Path, *, step: float, contacts: bool, held: str | None = None
) -> mujoco.MjModel:
    """Read an MJCF or URDF file.

    Args:
        path: Path of the file.
        step: Time step of the simulation [s].
        contacts: False disables contacts and ignores the collision shapes of a URDF.
        held: Name of a body that a constraint, `HELD`, holds; None: no constraint.

    Raises:
        ConfigurationError: MuJoCo or the file is missing, or the model is invalid.
    """
    path = Path(path)
    mujoco = import_mujoco(path)
    root = _root(path)
    try:
        if root.tag == "mujoco":
            spec = mujoco.MjSpec.from_file(str(path))
        else:
            meshes = _remove_shapes(root, path) if contacts else _remove_shapes(root)
            spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, "unicode"), assets=meshes)
        if held is not None:
            _hold(mujoco, spec, held)
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ConfigurationError(f"{path}: MuJoCo rejects the model: {error}") from error
    _set_options(mujoco, model, step=step, contacts=contacts)
    return model


def _hold(mujoco: Any, spec: Any, body: str) -> None:
    """Add a constraint that holds a body. Its pose is set later. Raises ValueError."""
    names = [each.name for each in spec.bodies if each.name != "world"]
    if body not in names:
        raise ValueError(f"no body {body!r} can be held; the bodies are {', '.join(names)}")
    kind, of = mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY
    spec.add_equality(name=HELD, type=kind, objtype=of, name1="world", name2=body)


def _set_options(mujoco: Any, model: mujoco.MjModel, *, step: float, contacts: bool) -> None:
    model.opt.timestep = step
    flags = mujoco.mjtDisableBit
    # Only the virtual motors act on the joints, and a failed simulation must not reset itself.
    model.opt.disableflags |= flags.mjDSBL_ACTUATION | flags.mjDSBL_AUTORESET
    if not contacts:
        model.opt.disableflags |= flags.mjDSBL_CONTACT


def import_mujoco(path: Path) -> Any:
    """Import MuJoCo. Raises ConfigurationError for the model `path` if it is not installed."""
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
