"""CONTRIBUTING.md, the hooks and the table of scenarios name what exists."""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import pytest

import catenary
from catenary.cli.main import make_parser

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "src" / "catenary"
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()
NAMED = sorted(set(re.findall(r"`([^`\n]+)`", CONTRIBUTING)))
PATH = re.compile(r"\.?[\w./-]+(\.(py|pyx|pyi|h|md|toml|yaml)|/)|[\w-]+/[\w-]+")
FUNCTION = re.compile(r"(\w+)\(\)")
EXAMPLE = re.compile(r"NAME|KIND")  # a file that the reader adds
GITHUB = ROOT / ".github"
FORMS = sorted([*GITHUB.glob("ISSUE_TEMPLATE/*.yml"), *GITHUB.glob("DISCUSSION_TEMPLATE/*.yml")])
COMMAND = re.compile(r"^ {12}catenary (?!--version)(.+)$", re.MULTILINE)
WITH_COMMANDS = {"bug", "device", "hardware_report", "q-a"}
HOOK = ROOT / "tools" / "commit_subject"


@pytest.mark.parametrize(
    "path", [name for name in NAMED if PATH.fullmatch(name) and not EXAMPLE.search(name)]
)
def test_paths_exist(path: str) -> None:
    assert (ROOT / path).exists() or (SOURCES / path).exists()


@pytest.mark.parametrize("name", [name for name in NAMED if FUNCTION.fullmatch(name)])
def test_functions_exist(name: str) -> None:
    pattern = f"def {name.removesuffix('()')}("
    assert any(pattern in path.read_text() for path in SOURCES.rglob("*.py"))


@pytest.mark.parametrize("form", FORMS, ids=lambda path: path.stem)
def test_commands_of_forms_parse(form: Path) -> None:
    calls = COMMAND.findall(form.read_text())
    for call in calls:
        make_parser().parse_args(shlex.split(call))
    assert bool(calls) == (form.stem in WITH_COMMANDS)


@pytest.mark.parametrize("form", FORMS, ids=lambda path: path.stem)
def test_forms_have_the_structure_that_github_requires(form: Path) -> None:
    yaml = pytest.importorskip("yaml")
    content = yaml.safe_load(form.read_text())
    if form.stem == "config":
        assert content == {"blank_issues_enabled": False}
        return
    if form.parent.name == "ISSUE_TEMPLATE":
        assert content["name"]
        assert content["description"]
    fields = [each for each in content["body"] if each["type"] != "markdown"]
    identifiers = [each["id"] for each in fields]
    assert fields
    assert len(set(identifiers)) == len(identifiers)
    for each in fields:
        assert each["attributes"]["label"]
        assert each["type"] in ("input", "textarea", "dropdown", "checkboxes")
        assert all(
            isinstance(option, str | dict) for option in each["attributes"].get("options", [""])
        )


def test_the_version_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert catenary.__version__ == project["version"]
    assert f"\n## {catenary.__version__} (" in (ROOT / "CHANGELOG.md").read_text()


def test_every_scenario_has_a_row_and_every_row_a_scenario() -> None:
    folder = ROOT / "tests" / "scenario"
    rows = re.findall(r"(?<=\| )(\d\d)(?= \|)", (folder / "README.md").read_text())
    assert sorted(rows) == sorted(path.name[:2] for path in folder.glob("[0-9][0-9]_*.py"))


@pytest.mark.parametrize(
    ("message", "status"),
    [
        (72 * "x" + "\n", 0),
        ("Add a device\n\n" + 100 * "x" + "\n", 0),
        ("# comment of git\nAdd a device\n", 0),
        (73 * "ä" + "\n", 1),
        ("Add a device.\n", 1),
        ("", 1),
    ],
)
def test_the_hook_checks_the_subject(tmp_path: Path, message: str, status: int) -> None:
    (tmp_path / "message").write_text(message)
    done = subprocess.run([HOOK, tmp_path / "message"], capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert bool(done.stderr) == bool(status)
