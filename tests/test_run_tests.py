"""tools/run_tests.py: which tests run in the second process, and when."""

from __future__ import annotations

import sys
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


@pytest.mark.parametrize(
    ("statuses", "failures", "may"),
    [
        ((1, 0), 1, True),
        ((1, 1), 3, True),
        ((1, 0), 4, False),  # too many: not an accident of the machine
        ((0, 0), 0, False),
        ((1, 0), 0, False),
        ((2, 1), 1, False),  # interrupted
        ((6, 1), 1, False),  # a required marker did not run
        ((-11, 1), 1, False),
    ],
)
def test_few_failed_tests_are_repeated(statuses: tuple[int, int], failures: int, may: bool) -> None:
    assert run_tests.may_repeat(statuses, ["tests/a.py::b"] * failures) is may


SOMETIMES = """
from pathlib import Path
def test_fails_once():
    first = Path(__file__).with_name("ran")
    fails = not first.exists()
    first.touch()
    assert not fails
def test_passes():
    pass
"""
ALWAYS = "def test_fails():\n    assert False\n"


@pytest.mark.parametrize(("text", "status"), [(SOMETIMES, 0), (SOMETIMES + ALWAYS, 1)])
def test_repeated_tests_decide(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    text: str,
    status: int,
) -> None:
    (tmp_path / "tests" / "virtual").mkdir(parents=True)
    (tmp_path / "conftest.py").write_text(
        "def pytest_addoption(parser): parser.addoption('--part', action='store_true')"
    )
    (tmp_path / "tests" / "test_real.py").write_text(text)
    (tmp_path / "tests" / "virtual" / "test_virtual.py").write_text("def test_passes(): pass")
    monkeypatch.setattr(run_tests, "TESTS", tmp_path / "tests")
    monkeypatch.setattr(run_tests, "VIRTUAL", ("virtual",))
    monkeypatch.setattr(run_tests, "PYTEST", (sys.executable, "-m", "pytest"))
    assert run_tests.main([]) == status
    output = capfd.readouterr().out
    assert "These tests failed, and run once more, alone: tests/test_real.py::test_fails" in output
    passed = "Passed only when repeated: tests/test_real.py::test_fails_once"
    assert (passed in output) is (status == 0)
