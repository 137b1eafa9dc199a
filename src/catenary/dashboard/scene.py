"""3D scene for the browser: shapes once, then poses. Little endian, no XML and no paths.

Scene (GET /scene):

0   8 bytes  "CATSCENE"
8   u32      version, 1
12  u32      number of bodies (the first is the world)
16  u32      number of shapes
20  u32      number of meshes
24  u32      bytes of the description
28  u32      0
32           description: JSON, padded with spaces to a multiple of 4:
             {"bodies": [name], "joints": [name of the joint of each axis, or null],
              "center": [x, y, z], "extent": meters}
...          shapes, 72 bytes each: u32 type (SHAPES), u32 body, i32 mesh (-1: none), u32 group,
             f32[3] size, f32[3] position, f32[4] quaternion (w, x, y, z), f32[4] colour (0 to 1);
             position and quaternion are relative to the body. Sizes are half lengths, as in MuJoCo:
             plane x, y (0: infinite), sphere r, capsule and cylinder r and half length along z,
             ellipsoid and box half axes
...          meshes: u32 vertices, u32 faces, f32[vertices][3], u32[faces][3]

Poses (binary message on /ws):

0   u8       kind, 3
1   u8       version, 1
2   u16      number of contacts
4   u32      number of bodies
8   u32 u32  0
16  f64      time [s]
24  f64      0
32  f32[bodies][7]    position [m] and quaternion (w, x, y, z) of each body
... f32[bodies][7]    the same at the targets of the axes
... f32[contacts][6]  position [m] and normal of each contact
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.dashboard.model_file import load_model
from catenary.errors import ConfigurationError

VERSION, POSES = 1, 3
HEAD = struct.Struct("<8s6I")
POSE_HEAD = struct.Struct("<BBHIIIdd")
PLANE, HEIGHT_FIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)  # mjtGeom
SHAPES = (PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH)
VISIBLE_GROUPS = 3  # groups 0 to 2, as MuJoCo's viewer shows
FREE, SLIDE, HINGE = 0, 2, 3  # mjtJoint
LARGEST = 64 << 20  # [bytes] of a scene
CONTACTS = 64
DEFAULT_COLOUR = (0.5, 0.5, 0.5, 1.0)  # of MuJoCo
SHAPE = np.dtype(
    [
        *((name, "<u4") for name in ("type", "body")),
        ("mesh", "<i4"),
        ("group", "<u4"),
        *((name, "<f4", 3) for name in ("size", "position")),
        *((name, "<f4", 4) for name in ("quaternion", "colour")),
    ]
)

Values = npt.NDArray[np.float64]


class Scene:
    """Shapes of a model, and the poses of its bodies at the positions of axes.

    Args:
        path: MJCF or URDF file. Its meshes are in its folder or below.
        axes: names of the axes.
        joints: joint of the model for the name of an axis. None: the joint with the name of the
            axis. If no joint has the name of an axis, and as many joints as axes exist, they
            correspond in their order.

        moves: True if the base moves: its pose is that of the first free joint.

    Raises:
        ConfigurationError: MuJoCo is not installed, the model cannot be read, a joint does not
            exist or cannot be moved by one axis, the model has no free joint for its base, or the
            scene is too large.
    """

    def __init__(
        self,
        path: str | Path,
        axes: Sequence[str],
        joints: Mapping[str, str] | None = None,
        *,
        moves: bool = False,
    ) -> None:
        self._model = load_model(Path(path))
        self._mujoco = _mujoco()
        self._data = self._mujoco.MjData(self._model)
        self.joints = joints_of_axes(self._model, axes, joints)
        self._driven = [axis for axis, joint in enumerate(self.joints) if joint is not None]
        self._places = [
            int(self._model.joint(joint).qposadr[0]) for joint in self.joints if joint is not None
        ]
        self._initial = self._data.qpos.copy()
        self._base = free_joint(self._model) if moves else None
        self.data = encode_scene(self._model, self.joints)

    def poses(
        self, time: float, position: Values, target: Values, base: Values | None = None
    ) -> bytes:
        """Return the message with the poses of all bodies.

        Args:
            time: time of the positions [s].
            position: (axes,) [rad or m]; NaN: the initial position of the model.
            target: (axes,) [rad or m]; NaN: the same as `position`.
            base: (7,) position [m] and quaternion (w, x, y, z) of the base; None: the last one, or
                the initial pose of the model.
        """
        if base is not None and self._base is not None:
            self._initial[self._base : self._base + 7] = base
        target = np.where(np.isfinite(target), target, position)
        ghost = self._solve(target)
        actual = self._solve(position)
        contacts = self._contacts()
        head = POSE_HEAD.pack(POSES, VERSION, len(contacts), len(actual), 0, 0, time, 0.0)
        return head + actual.tobytes() + ghost.tobytes() + contacts.tobytes()

    def _solve(self, position: Values) -> npt.NDArray[np.float32]:
        """Return the poses of all bodies, (bodies, 7)."""
        data = self._data
        data.qpos[:] = self._initial
        driven = position[self._driven]
        data.qpos[self._places] = np.where(np.isfinite(driven), driven, data.qpos[self._places])
        self._mujoco.mj_fwdPosition(self._model, data)
        return np.hstack([data.xpos, data.xquat]).astype("<f4")

    def _contacts(self) -> npt.NDArray[np.float32]:
        """Return position and normal of the contacts of the last solution, (contacts, 6)."""
        contact = self._data.contact
        count = min(self._data.ncon, CONTACTS)
        return np.hstack([contact.pos[:count], contact.frame[:count, :3]]).astype("<f4")


def free_joint(model: Any) -> int:
    """Return the place of the first free joint in qpos.

    Raises ConfigurationError if the model has none.
    """
    for joint in range(model.njnt):
        if model.jnt_type[joint] == FREE:
            return int(model.jnt_qposadr[joint])
    raise ConfigurationError(
        "the model has no free joint, so its base cannot move",
        hint="omit --base, or add <freejoint/> to the base of the model",
    )


def joints_of_axes(
    model: Any, axes: Sequence[str], joints: Mapping[str, str] | None
) -> tuple[str | None, ...]:
    """Return the name of the joint of each axis; None for an axis without a joint.

    Args:
        model: the mjModel.
        axes: names of the axes.
        joints: joint by the name of the axis; None: see `Scene`.
    """
    movable = [
        model.joint(n).name for n in range(model.njnt) if model.jnt_type[n] in (SLIDE, HINGE)
    ]
    if joints is None:
        named = any(axis in movable for axis in axes)
        joints = (
            dict(zip(axes, movable, strict=True))
            if not named and len(axes) == len(movable)
            else {axis: axis for axis in axes if axis in movable}
        )
    for axis, joint in joints.items():
        if joint not in movable or axis not in axes:
            raise ConfigurationError(
                f"joint {joint!r} cannot follow axis {axis!r}",
                hint=f"joints of the model: {', '.join(movable)}; axes: {', '.join(axes)}",
            )
    return tuple(joints.get(axis) for axis in axes)


def encode_scene(model: Any, joints: Sequence[str | None]) -> bytes:
    """Return the shapes and meshes of a model.

    Args:
        model: the mjModel.
        joints: name of the joint of each axis.

    Raises:
        ConfigurationError: The scene is too large.
    """
    shown = shown_geoms(model)
    used = sorted({int(model.geom_dataid[g]) for g in shown if model.geom_type[g] == MESH})
    description = {
        "bodies": [model.body(n).name for n in range(model.nbody)],
        "joints": list(joints),
        "center": [float(x) for x in model.stat.center],
        "extent": float(model.stat.extent),
    }
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    head = HEAD.pack(b"CATSCENE", VERSION, model.nbody, len(shown), len(used), len(text), 0)
    meshes = [encode_mesh(model, mesh) for mesh in used]
    data = b"".join([head, text, encode_shapes(model, shown, used), *meshes])
    if len(data) > LARGEST:
        raise ConfigurationError(
            f"the scene has {len(data) >> 20} MiB, more than {LARGEST >> 20} MiB",
            hint="use meshes with fewer faces",
        )
    return data


def shown_geoms(model: Any) -> list[int]:
    """Return the geoms that the page shows. Of a URDF, these are the visual shapes if it has any.

    MuJoCo puts them in group 1 without contacts.
    """
    visible = [
        geom
        for geom in range(model.ngeom)
        if model.geom_group[geom] < VISIBLE_GROUPS and model.geom_type[geom] in SHAPES
    ]
    visual = {int(model.geom_bodyid[g]) for g in visible if is_visual(model, g)}
    return [g for g in visible if is_visual(model, g) or int(model.geom_bodyid[g]) not in visual]


def is_visual(model: Any, geom: int) -> bool:
    """Return True if the geom is a visual shape: in group 1 or 2, and without contacts."""
    touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
    return bool(model.geom_group[geom] in (1, 2) and not touches)


def encode_shapes(model: Any, geoms: Sequence[int], meshes: Sequence[int]) -> bytes:
    """Return the table of shapes.

    Args:
        model: the mjModel.
        geoms: numbers of the geoms.
        meshes: numbers of the meshes, in the order of the scene.
    """
    rows = np.zeros(len(geoms), SHAPE)
    for row, geom in zip(rows, geoms, strict=True):
        is_mesh = model.geom_type[geom] == MESH
        row["type"], row["body"] = model.geom_type[geom], model.geom_bodyid[geom]
        row["mesh"] = meshes.index(int(model.geom_dataid[geom])) if is_mesh else -1
        row["group"], row["size"] = model.geom_group[geom], model.geom_size[geom]
        row["position"], row["quaternion"] = model.geom_pos[geom], model.geom_quat[geom]
        row["colour"] = colour(model, geom)
    return rows.tobytes()


def colour(model: Any, geom: int) -> Values:
    """Return the colour of a geom: that of its material, unless it has an own one."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    is_default = np.allclose(own, DEFAULT_COLOUR)
    found: Values = model.mat_rgba[material] if material >= 0 and is_default else own
    return found


def encode_mesh(model: Any, mesh: int) -> bytes:
    """Return the vertices and faces of a mesh.

    Args:
        model: the mjModel.
        mesh: number of the mesh.
    """
    vertex, vertices = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    points = model.mesh_vert[vertex : vertex + vertices].astype("<f4")
    corners = model.mesh_face[face : face + faces].astype("<u4")
    head = struct.pack("<II", vertices, faces)
    return b"".join([head, points.tobytes(), corners.tobytes()])


def _mujoco() -> Any:
    from importlib import import_module

    return import_module("mujoco")
