"""The command `make rtlab`: tables, results and errors."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import pytest

from tools.rtlab import __main__ as lab
from tools.rtlab import image, kernel, machine, record, tables
from tools.rtlab.errors import LabError

ROOT = Path(__file__).resolve().parents[2]


def test_all_omits_quick_two_lengths_of_tocabi_and_humanoid() -> None:
    omitted = {"quick", "tocabi-60", "tocabi-8k", "humanoid"}
    assert set(tables.choose(["all"])) == set(tables.TABLES) - omitted


def test_tables_are_selected_by_name_with_or_without_commas() -> None:
    assert list(tables.choose(["quick,law", "loop"])) == ["quick", "law", "loop"]


def test_an_unknown_table_lists_the_known_ones(capsys) -> None:
    assert lab.main(["nothing"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "'nothing'" in said
    assert "quick" in said


def test_every_table_is_a_benchmark_that_writes_its_figures() -> None:
    from benchmarks.cli.main import make_parser

    commands = [table for table in tables.TABLES.values() if not table.program]
    assert len(commands) == len(tables.TABLES) - 2  # igh and gpio are programs of the guest
    for table in commands:
        asked = make_parser().parse_args(table.arguments)
        assert asked.json == Path(tables.RESULT)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "/x/root.part"), "the disk is full"),
        (PermissionError(errno.EACCES, "Permission denied", "/x"), "Permission denied (/x)"),
        (LabError("no apt"), "no apt"),
    ],
)
def test_errors_have_one_line(
    error: Exception, said: str, capsys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise error

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(machine, "program", lambda: "qemu")
    monkeypatch.setattr(kernel, "provide", lambda _: None)
    monkeypatch.setattr(image, "provide", refuse)
    assert lab.main(["quick", "--out", str(tmp_path)]) == 1
    captured = capsys.readouterr().err
    assert captured.count("\n") == 1
    assert said in captured


def test_a_full_disk_leaves_no_partial_image(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(image.archive, "write", full)
    with pytest.raises(OSError, match="No space"):
        image.write([], tmp_path / "root.cpio")
    assert list(tmp_path.iterdir()) == []


def test_the_image_is_rebuilt_only_if_the_kernel_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setattr(image.root, "entries", lambda *_: [])
    monkeypatch.setattr(image.root, "everything", lambda *_: [])
    monkeypatch.setattr(image, "compile_all", lambda _: [])

    def made(package: str) -> bool:
        image.provide(kernel.Kernel(Path(), Path(), package), ROOT, tmp_path)
        return "making" in capsys.readouterr().out

    assert [made(name) for name in ("a", "a", "b", "b")] == [True, False, True, False]


def test_a_record_contains_the_conditions_of_its_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "version", lambda: "7.2.22")
    answer = {"kernel": "6.1 PREEMPT_RT", "status": 0, "seconds": 2.0, "result": {"lost": 0}}
    made = record.make(
        answer, tables.TABLES["quick"], kernel.Kernel(Path(), Path(), "linux_1"), ROOT, 9.0
    )
    assert json.loads(json.dumps(made)) == made
    assert made["ns_per_instruction"] == 1
    assert made["command"].startswith("python -m benchmarks loop")
    assert (made["kernel_package"], made["qemu"]) == ("linux_1", "7.2.22")
    assert "does not measure the latency of hardware" in made["note"]
