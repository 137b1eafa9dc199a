"""tools/run_tests.py: which tests run in which process, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import FIXTURE_OF
from tools import run_tests

ROOT = Path(__file__).resolve().parent.parent


def test_every_folder_of_a_process_has_tests_and_is_in_one_process() -> None:
    names = [*run_tests.PATIENT, *(name for group in run_tests.VIRTUAL for name in group)]
    assert len(names) == len(set(names)) > 10
    for name in names:
        assert list((ROOT / "tests" / name).rglob("test_*.py")), name


@pytest.mark.parametrize(("processors", "count"), [(1, 1), (2, 1), (4, 2), (64, 2)])
def test_all_folders_in_virtual_time_run_on_any_machine(processors: int, count: int) -> None:
    groups = run_tests.groups(processors)
    assert len(groups) == count
    assert sorted(sum(groups, ())) == sorted(sum(run_tests.VIRTUAL, ()))


def test_the_patient_process_has_tests_of_its_markers() -> None:
    """A required marker of it must have a test that passes there; others, in real time."""
    assert set(FIXTURE_OF) == run_tests.MARKERS
    assert run_tests.elsewhere(["ros2", "browser"]) == ["--elsewhere=browser", "--elsewhere=ros2"]
    users = {
        path.relative_to(ROOT / "tests").parts[0]
        for path in (ROOT / "tests").rglob("*.py")
        if "(chromium: str" in (text := path.read_text()) or "ros2: Path" in text
    }
    assert set(run_tests.PATIENT) <= users


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
