"""`init`, `check`, and a machine file as TARGET."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from catenary.cli.main import VIRTUAL_TIME, main
from tests.machine.files import SMALL, write_small


def call(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    status = main([str(word) for word in words])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_check_accepts_a_file_written_by_init(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = tmp_path / "line.toml"
    line.write_text('[[device]]\nkind = "coupler"\n[[device]]\nkind = "digital_outputs"\n')
    path = tmp_path / "machine.toml"
    status, out, _ = call(capsys, "init", f"virtual:{line}", "-o", path)
    assert status == 0
    assert out == f"{path}: 2 devices\n"
    assert tomllib.loads(path.read_text())["target"] == "virtual:line.toml"
    status, out, _ = call(capsys, "check", path)
    assert status == 0
    assert [words.split()[:2] for words in out.splitlines()[1:]] == [
        ["same", "cvk100"],
        ["same", "cvo004"],
    ]


def test_check_accepts_any_suffix(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_small(tmp_path).rename(tmp_path / "cell.cfg")
    assert call(capsys, "check", path)[0] == 0


def test_init_names_the_lines_to_fill_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "machine.toml"
    status, out, _ = call(capsys, "init", "virtual", "-o", path)
    assert status == 0
    number = next(
        n for n, line in enumerate(path.read_text().splitlines(), 1) if "counts_per_turn" in line
    )
    assert f"{path}:{number}: FILL IN" in out
    status, _, err = call(capsys, "check", path)
    assert status == 2
    assert 'remove the "#" from the lines marked FILL IN' in err


def test_init_does_not_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "machine.toml"
    path.write_text("mine")
    status, _, err = call(capsys, "init", "virtual", "-o", path)
    assert status == 2
    assert "already exists" in err
    assert path.read_text() == "mine"
    assert call(capsys, "init", "virtual", "-o", path, "--force")[0] == 0
    assert "catenary-machine/1" in path.read_text()


def test_init_needs_a_target(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call(capsys, "init")
    assert status == 2
    assert "TARGET is missing" in err


def test_init_prints_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "init", "--schema")
    assert status == 0
    assert json.loads(out)["$schema"].startswith("https://json-schema.org/")


def test_check_compares_without_changing_a_device(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_small(tmp_path)
    assert call(capsys, "check", path)[0] == 0
    line = tmp_path / "line.toml"
    line.write_text(line.read_text().replace("alias = 12", "alias = 13"))
    status, out, _ = call(capsys, "check", path)
    assert status == 1
    rows = {row.split()[1]: row for row in out.splitlines()[1:]}
    assert rows["j1"].startswith("same")
    assert rows["wrist"].startswith("missing")
    assert "catenary alias TARGET 4 12" in rows["wrist"]
    assert rows["Catenary"].startswith("unknown")


def test_check_with_another_target(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "check", write_small(tmp_path), "virtual")
    assert status == 1
    assert "different  gauge" in out


def test_check_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "check", write_small(tmp_path), "--json")
    assert status == 0
    rows = json.loads(out)
    assert rows[3] == {
        "verdict": "same",
        "name": "j1",
        "address": "alias 11",
        "position": 3,
        "expected": "vendor 0x43544E59 product 0x00050001",
        "found": rows[3]["found"],
        "fault": "",
        "cause": "",
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SMALL.replace("period", "perod"), "loop.perod: unknown key"),
        (SMALL.replace("virtual:line.toml", "virtual:nothing.toml"), "nothing.toml: No such file"),
    ],
)
def test_exit_status_of_unreadable_files(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(capsys, "check", write_small(tmp_path, text))
    assert (status, out) == (2, "")
    assert message in err


@pytest.mark.parametrize(
    "words",
    [
        ("scan",),
        ("state",),
        ("graph",),
        ("diag",),
        ("alias", "0"),
        ("reg", "read", "0", "AL_STATUS"),
        ("sii", "read", "0"),
        ("sdo", "read", "3", "0x1018:1"),
    ],
)
def test_a_machine_file_is_a_target(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_small(tmp_path)
    first = 2 if words[0] in ("reg", "sii", "sdo") else 1
    status, out, err = call(capsys, *words[:first], path, *words[first:])
    assert status == 0
    assert err == f"note: {VIRTUAL_TIME}\n"
    assert out


def test_a_machine_file_without_a_target_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_small(tmp_path, SMALL.replace('target = "virtual:line.toml"\n', ""))
    status, _, err = call(capsys, "scan", path)
    assert status == 1
    assert 'key "target" is missing' in err
    assert 'write target = "eth0"' in err


def test_a_graph_starts_at_the_target_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_small(tmp_path)
    (tmp_path / "line.toml").unlink()
    path.write_text(path.read_text().replace("virtual:line.toml", "virtual"))
    status, out, _ = call(capsys, "graph", path)
    assert status == 0
    assert out.splitlines()[1].split()[4] == "virtual"
