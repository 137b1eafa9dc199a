"""docs/explanation/architecture.md names all packages, and only existing files."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "catenary"
TEXT = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
NAMED = sorted(set(re.findall(r"`([^`\s]+)`", TEXT)))
PLACES = (ROOT, PACKAGE, *(path for path in PACKAGE.rglob("*") if path.is_dir()))
FILE = re.compile(r"[\w/]+\.(py|pyx|h|c|toml|md)|\w+(/\w+)+/?")
FUNCTION = re.compile(r"(\w+/\w+)\.(\w+)")
LINES_MAX, PARAMETERS_MAX = 40, 8
Functions = list[tuple[str, ast.FunctionDef]]
VOCABULARY = "public keywords, one per physical quantity or quirk"
LONG = {
    "drive/drives.py: Drives.__init__": VOCABULARY,
    "virtual/devices/servo.py: Servo.__init__": VOCABULARY,
}
WIDE = {
    **LONG,
    "drive/process_data.py: ProcessData.__init__": VOCABULARY,
    "loop/loop.py: Loop.__init__": VOCABULARY,
    "machine/machine.py: Machine.loop": "the options of Loop",
    "virtual/devices/analog_inputs.py: AnalogInputs.__init__": VOCABULARY,
    "virtual/devices/model_sensor.py: ModelSensor.__init__": VOCABULARY,
    "virtual/devices/oversampling.py: OversamplingTerminal.__init__": VOCABULARY,
    **{
        f"control/{place}": "step of a law, compiled by numba"
        for place in (
            "admittance.py: natural_admittance",
            "cascade.py: cascade",
            "impedance.py: impedance",
            "pid.py: pid_step",
        )
    },
}


@pytest.mark.parametrize("name", [name for name in NAMED if FILE.fullmatch(name)])
def test_files_and_folders_exist(name: str) -> None:
    assert any((place / name).exists() for place in PLACES)


@pytest.mark.parametrize(
    "name", [n for n in NAMED if FUNCTION.fullmatch(n) and not FILE.fullmatch(n)]
)
def test_functions_exist(name: str) -> None:
    module, function = name.rsplit(".", 1)
    assert f"def {function}(" in (PACKAGE / f"{module}.py").read_text()


@pytest.mark.parametrize(
    "name",
    sorted(
        path.stem
        for path in PACKAGE.iterdir()
        if (path.name.isidentifier() and not path.name.startswith("_")) or path.suffix == ".py"
    ),
)
def test_every_package_is_explained(name: str) -> None:
    assert name == "__init__" or re.search(rf"^\|[^|]*`{name}/?`", TEXT, re.MULTILINE)


def test_the_state_of_free_threading_is_declared_once_for_all_compiled_modules() -> None:
    root = Path(__file__).resolve().parent.parent
    assert "-X freethreading_compatible=False" in (root / "CMakeLists.txt").read_text()
    sources = list((root / "src").rglob("*.pyx"))
    assert sources
    assert not [path for path in sources if "freethreading" in path.read_text()]


@pytest.fixture(scope="module")
def functions() -> Functions:
    """Return every Python function of the package, named by its file and class."""
    return list(parsed())


def parsed() -> Iterator[tuple[str, ast.FunctionDef]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        owners = {
            id(child): f"{node.name}."
            for node in ast.walk(tree)
            if isinstance(node, ast.ClassDef)
            for child in node.body
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                owner = owners.get(id(node), "")
                yield f"{path.relative_to(PACKAGE)}: {owner}{node.name}", node


def line_count(function: ast.FunctionDef) -> int:
    """Return the number of lines without the docstring."""
    assert function.end_lineno is not None
    count = function.end_lineno - function.lineno + 1
    if ast.get_docstring(function, clean=False) is None:
        return count
    docstring = function.body[0]
    assert docstring.end_lineno is not None
    return count - (docstring.end_lineno - docstring.lineno + 1)


def parameter_count(function: ast.FunctionDef) -> int:
    """Return the number of parameters without `self` or `cls`."""
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_no_function_is_longer_than_40_lines(functions: Functions) -> None:
    long = {name for name, function in functions if line_count(function) > LINES_MAX}
    assert long == set(LONG)


def test_no_function_has_more_than_8_parameters(functions: Functions) -> None:
    wide = {name for name, function in functions if parameter_count(function) > PARAMETERS_MAX}
    assert wide == set(WIDE)
