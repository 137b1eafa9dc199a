"""The layers of pyproject.toml, also for compiled modules, which import-linter does not check.

Every import and cimport of .py, .pyi, .pyx, .pxd and .pxi is read as text. Upper layers import
lower ones. Siblings (`|`) do not import each other. Compiled modules (`_name.pyx`) are private to
their package. No file includes a file of another package.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SUFFIXES = {".py", ".pyi", ".pyx", ".pxd", ".pxi"}

FROM = re.compile(r"^[ \t]*from\s+([\w.]+)\s+c?import\s+(\([^)]*\)|.*)", re.MULTILINE)
PLAIN = re.compile(r"^[ \t]*c?import\s+([\w.]+(?:\s+as\s+\w+)?(?:\s*,\s*[\w. ]+)*)", re.MULTILINE)
INCLUDE = re.compile(
    r"""^[ \t]*include\s+["']([^"']+)["']|cdef extern from "([^"<]+)":?""", re.MULTILINE
)


@dataclass(frozen=True)
class Layers:
    """`level` of each package, 0 on top; packages of one level are siblings."""

    level: dict[str, int]
    forbidden: set[tuple[str, str]]

    def allow(self, package: str, imported: str) -> bool:
        if package == imported:
            return True
        if (package, imported) in self.forbidden:
            return False
        return self.level[package] < self.level[imported]


def read_layers() -> Layers:
    configuration = tomllib.loads((ROOT / "pyproject.toml").read_text())
    level: dict[str, int] = {}
    forbidden: set[tuple[str, str]] = set()
    for contract in configuration["tool"]["importlinter"]["contracts"]:
        if contract["type"] == "layers":
            for number, names in enumerate(contract["layers"]):
                level.update({name.strip(" ()"): number for name in names.split("|")})
        elif contract["type"] == "forbidden":
            forbidden |= {
                (source.removeprefix("catenary."), target.removeprefix("catenary."))
                for source in contract["source_modules"]
                for target in contract["forbidden_modules"]
            }
    return Layers(level, forbidden)


LAYERS = read_layers()


def module_of(path: str) -> list[str]:
    """Return the dotted name of a file below src, as parts. `__init__` stands for its package."""
    parts = list(Path(path).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "__init__" else parts


def imports(path: str, text: str) -> Iterator[list[str]]:
    """Return the modules that a file may import: `from a.b import c` may be a.b or a.b.c."""
    text = re.sub(r'""".*?"""|#[^\n]*', "", text, flags=re.DOTALL)  # examples in docstrings too
    package = list(Path(path).parent.parts)
    for source, names in FROM.findall(text):
        dots = len(source) - len(source.lstrip("."))
        above = package[: len(package) - dots + 1] if dots else []
        base = above + [part for part in source.lstrip(".").split(".") if part]
        yield base
        for name in re.findall(r"(\w+)(?:\s+as\s+\w+)?\s*(?:,|\)|\\|$|\n)", names):
            yield [*base, name]
    for modules in PLAIN.findall(text):
        for module in modules.split(","):
            yield module.split()[0].split(".")


def objections(path: str, text: str, layers: Layers) -> list[str]:
    """Return the forbidden imports of a file, given by its path below src."""
    module = module_of(path)
    found = []
    for imported in imports(path, text):
        if imported[0] != "catenary" or len(imported) < 2 or len(module) < 2:
            continue  # another package, or catenary/__init__, which is above all layers
        if imported[1] in layers.level and not layers.allow(module[1], imported[1]):
            found.append(f"{path}: {module[1]} must not import {'.'.join(imported)}")
        private = [part for part in imported[2:] if re.match(r"_[^_]", part)]
        if private and imported[1] != module[1] and len(imported) > 2:
            found.append(f"{path}: {'.'.join(imported)} is private to catenary.{imported[1]}")
    for included, header in INCLUDE.findall(text):
        if ".." in (included or header) or "/" in included:
            found.append(f"{path}: includes {included or header} of another place")
    return found


def sources() -> dict[str, str]:
    files = (path for path in (ROOT / "src").rglob("*") if path.suffix in SUFFIXES)
    return {str(path.relative_to(ROOT / "src")): path.read_text() for path in files}


def test_every_package_has_a_layer():
    packages = {path.parent.name for path in (ROOT / "src/catenary").glob("*/__init__.py")}
    modules = {path.stem for path in (ROOT / "src/catenary").glob("*.py")} - {"__init__"}
    assert packages | modules <= set(LAYERS.level)


def test_no_file_violates_the_layers():
    files = sources()
    assert {Path(path).suffix for path in files} >= {".py", ".pyi", ".pyx", ".pxd"}
    assert [line for path, text in files.items() for line in objections(path, text, LAYERS)] == []


def test_the_core_does_not_import_catenary():
    foreign = [
        (path, imported)
        for path, text in sources().items()
        if path.startswith("catenary/core/")
        for imported in imports(path, text)
        if imported[0] == "catenary" and imported[:2] != ["catenary", "core"]
    ]
    assert foreign == []


def test_native_headers_include_only_each_other_and_the_system():
    headers = {path.name: path.read_text() for path in (ROOT / "src/catenary/native").glob("*.h")}
    included = {
        name for text in headers.values() for name in re.findall(r'#include "([^"]+)"', text)
    }
    assert headers
    assert included <= set(headers)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("catenary/core/_engine.pyx", "from catenary.errors import LinkError"),
        ("catenary/core/_engine.pyx", "import numpy, catenary.wire.frame as frame"),
        ("catenary/virtual/_segment.pyx", "from catenary.link._table cimport TableLink"),
        ("catenary/virtual/serve.py", "def f():\n    from catenary import link"),
        ("catenary/bus/x.py", "from catenary.core._engine import Engine"),
        ("catenary/bus/x.py", "from catenary.core import _engine"),
        ("catenary/bus/x.py", "from catenary.core import (\n    Engine,\n    _engine,\n)"),
        ("catenary/wire/_fast.pxd", "cimport catenary.core._engine as engine"),
        ("catenary/wire/_fast.pyi", "from ..model import identity"),
        ("catenary/loop/loop.py", "from catenary import drive"),
        ("catenary/drive/_x.pyx", 'include "../core/engine.pxi"'),
        ("catenary/drive/_x.pyx", 'cdef extern from "../core/engine.h":'),
    ],
)
def test_a_forbidden_import_is_found(path, text):
    assert objections(path, text, LAYERS)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("catenary/core/_engine.pyx", "from catenary.core._image cimport image"),
        ("catenary/core/_engine.pyx", 'cdef extern from "link.h" nogil:\n    pass'),
        ("catenary/bus/x.py", "from catenary.core import Engine  # not catenary.loop"),
        ("catenary/wire/frame.py", "from . import datagram"),
        ("catenary/wire/frame.py", '"""Example:\n\n    from catenary.bus import MainDevice\n"""'),
        ("catenary/virtual/x.py", "import catenary.wire.frame as frame, os"),
        ("catenary/__init__.py", "from catenary.loop import Loop"),
    ],
)
def test_an_allowed_import_is_accepted(path, text):
    assert objections(path, text, LAYERS) == []
