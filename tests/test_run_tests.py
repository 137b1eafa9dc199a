"""tools/run_tests.py: which tests run in the second process, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools import run_tests

ROOT = Path(__file__).resolve().parent.parent


def test_every_folder_of_the_second_process_has_tests() -> None:
    names = run_tests.VIRTUAL
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


@pytest.mark.parametrize(
    ("statuses", "status"), [((0, 0), 0), ((0, 1), 1), ((-11, 0), -11), ((0, -9), -9)]
)
def test_a_process_that_a_signal_ended_is_a_failure(statuses: tuple[int, int], status: int) -> None:
    assert run_tests.first_failure(statuses) == status
