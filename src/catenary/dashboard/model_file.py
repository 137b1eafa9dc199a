"""Model of the 3D view: an MJCF or URDF file, read with its meshes into one MuJoCo model.

The XML is read here, so that it names no file outside of the model's folder. Only `<include>` and
`<mesh>` may name files. Textures are removed, because the page shows colours only. A URDF keeps
its visual shapes. MuJoCo receives the text and the content of the meshes, but no path.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from importlib import import_module
from pathlib import Path
from typing import Any

from catenary.errors import ConfigurationError

LARGEST_TEXT = 16 << 20  # [bytes]
LARGEST_MESHES = 256 << 20  # [bytes], of all files
INCLUDES = 64  # files
PACKAGE = "package://"
FILE_KEYS = ("file", "filename")  # of MJCF and URDF
URDF_COMPILER = {"discardvisual": "false", "fusestatic": "false", "strippath": "false"}
DIRECTORIES = ("meshdir", "assetdir", "texturedir", "strippath")
HINT = "place the file in the folder of the model, or below it"


def load_model(path: Path) -> Any:
    """Return the mjModel of an MJCF or URDF file with its meshes.

    Raises:
        ConfigurationError: MuJoCo or a file is missing, a file is too large or outside of the
            folder of the model, or MuJoCo rejects the model.
    """
    try:
        mujoco: Any = import_module("mujoco")
    except ImportError as error:
        raise ConfigurationError(
            "the 3D view needs MuJoCo, which is not installed", hint="pip install 'catenary[sim]'"
        ) from error
    root, meshes = Folder(path).read()
    text = ElementTree.tostring(root, "unicode")
    try:
        return mujoco.MjModel.from_xml_string(text, meshes)
    except ValueError as error:
        raise ConfigurationError(f"{path}: MuJoCo rejects the model: {error}") from error


class Folder:
    """Reader of a model and of the files that it names, all of them in its folder."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._folder = path.resolve().parent
        self._includes = 0
        self._size = 0
        self._meshes: dict[str, bytes] = {}  # by the name that replaces the path
        self._names: dict[Path, str] = {}

    def read(self) -> tuple[ElementTree.Element, dict[str, bytes]]:
        """Return the XML without paths, and the content of the meshes by name."""
        root = self._parse(self._path)
        if root.tag == "robot":
            self._expose_visuals(root)
        else:
            self._insert_includes(root)
        self._remove_textures(root)
        self._refuse_other_files(root)
        directory = self._mesh_directory(root)
        for mesh in root.iter("mesh"):
            self._take_mesh(mesh, directory)
        return root, self._meshes

    def _parse(self, path: Path) -> ElementTree.Element:
        try:
            with path.open("rb") as stream:
                data = stream.read(LARGEST_TEXT + 1)
            if len(data) > LARGEST_TEXT:
                raise ConfigurationError(f"{path} is larger than {LARGEST_TEXT >> 20} MiB")
            text = data.decode("utf-8-sig")
            if "<!DOCTYPE" in text:
                raise ConfigurationError(f"{path} has a DOCTYPE; remove it")
            return ElementTree.fromstring(text)
        except OSError as error:
            raise ConfigurationError(f"{path}: {error.strerror}") from error
        except (UnicodeDecodeError, ElementTree.ParseError) as error:
            raise ConfigurationError(f"{path} is not valid XML: {error}") from error

    def _insert_includes(self, parent: ElementTree.Element) -> None:
        """Replace each `<include>` by the elements of its file."""
        for child in list(parent):
            if child.tag != "include":
                self._insert_includes(child)
                continue
            self._includes += 1
            if self._includes > INCLUDES:
                raise ConfigurationError(f"{self._path} includes more than {INCLUDES} files")
            included = self._parse(self._inside(self._folder, child.get("file", "")))
            self._insert_includes(included)
            at = list(parent).index(child)
            parent[at : at + 1] = list(included)

    def _expose_visuals(self, root: ElementTree.Element) -> None:
        extension = root.find("mujoco")
        extension = ElementTree.SubElement(root, "mujoco") if extension is None else extension
        compiler = extension.find("compiler")
        compiler = ElementTree.SubElement(extension, "compiler") if compiler is None else compiler
        compiler.attrib.update(URDF_COMPILER)

    def _remove_textures(self, root: ElementTree.Element) -> None:
        for parent in list(root.iter()):
            parent.attrib.pop("texture", None)
            for child in list(parent):
                if child.tag in ("texture", "layer"):
                    parent.remove(child)

    def _refuse_other_files(self, root: ElementTree.Element) -> None:
        for element in root.iter():
            if element.tag != "mesh" and any(key.startswith("file") for key in element.attrib):
                raise ConfigurationError(
                    f"{self._path}: <{element.tag}> names a file; the 3D view reads meshes only"
                )

    def _mesh_directory(self, root: ElementTree.Element) -> Path:
        """Return the folder of the meshes, and remove all folders from the XML."""
        found = ""
        for compiler in root.iter("compiler"):
            found = compiler.get("meshdir") or compiler.get("assetdir") or found
            for key in DIRECTORIES:
                if root.tag != "robot" or key != "strippath":
                    compiler.attrib.pop(key, None)
        return self._inside(self._folder, found) if found else self._folder

    def _take_mesh(self, mesh: ElementTree.Element, directory: Path) -> None:
        key = next((key for key in FILE_KEYS if key in mesh.attrib), None)
        if key is None:
            return  # vertices in the XML
        given = mesh.attrib[key]
        path = self._find(given, directory)
        if path not in self._names:
            self._names[path] = f"mesh{len(self._names)}{path.suffix.lower()}"
            self._meshes[self._names[path]] = self._content(path)
        if key == "file":
            mesh.attrib.setdefault("name", Path(given).stem)  # as MuJoCo names it
        mesh.attrib[key] = self._names[path]

    def _find(self, given: str, directory: Path) -> Path:
        """Return the file of a mesh. `package://NAME/a/b.stl` is a/b.stl or NAME/a/b.stl."""
        if not given.startswith(PACKAGE):
            return self._inside(directory, given.removeprefix("file://"))
        whole = given.removeprefix(PACKAGE)
        candidates = (whole.partition("/")[2], whole, Path(whole).name)
        paths = [self._inside(directory, each) for each in candidates]
        return next((path for path in paths if path.is_file()), paths[0])

    def _inside(self, directory: Path, name: str) -> Path:
        path = (directory / name).resolve()
        if not path.is_relative_to(self._folder):
            raise ConfigurationError(
                f"{self._path}: {name!r} is outside of the folder of the model", hint=HINT
            )
        return path

    def _content(self, path: Path) -> bytes:
        try:
            with path.open("rb") as stream:
                content = stream.read(LARGEST_MESHES - self._size + 1)
        except OSError as error:
            raise ConfigurationError(f"{path}: {error.strerror}", hint=HINT) from error
        self._size += len(content)
        if self._size > LARGEST_MESHES:
            raise ConfigurationError(
                f"the meshes of {self._path} are larger than {LARGEST_MESHES >> 20} MiB"
            )
        return content
