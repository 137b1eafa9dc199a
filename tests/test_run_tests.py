"""tools/run_tests.py: which tests run in the second process, and when."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SPEC = importlib.util.spec_from_file_location("run_tests", ROOT / "tools" / "run_tests.py")
assert SPEC is not None
assert SPEC.loader is not None
run_tests = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(run_tests)


def test_every_folder_of_the_second_process_has_tests() -> None:
    names = run_tests.VIRTUAL.split()
    assert len(names) == len(set(names)) > 10
    for name in names:
        assert list((ROOT / "tests" / name).rglob("test_*.py")), name


@pytest.mark.parametrize(
    ("arguments", "both"),
    [
        ([], True),
        (["--require", "wire", "--require", "tshark"], True),
        (["tests/drive"], False),
        (["-k", "limits"], False),
        (["--require", "wire", "-x"], False),
        (["--require"], False),
    ],
)
def test_a_selection_of_tests_needs_one_process(arguments: list[str], both: bool) -> None:
    assert run_tests.only_requires(arguments) is both
