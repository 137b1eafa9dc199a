"""docs/explanation/architecture.md names all packages, and only existing files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "catenary"
TEXT = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
NAMED = sorted(set(re.findall(r"`([^`\s]+)`", TEXT)))
PLACES = (ROOT, PACKAGE, *(path for path in PACKAGE.rglob("*") if path.is_dir()))
FILE = re.compile(r"[\w/]+\.(py|pyx|h|c|toml|md)|\w+(/\w+)+/?")
FUNCTION = re.compile(r"(\w+/\w+)\.(\w+)")


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
