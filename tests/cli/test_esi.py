"""`catenary esi`: results, exit statuses, and errors that name the next step."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from catenary.cli.esi_commands import key_of
from catenary.cli.main import main
from tests.esi.esi_file import VENDOR, device, esi, module, write


@pytest.fixture(autouse=True)
def home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "library"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def drives(home: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """ESI file in the library: two revisions of one drive, and a coupler with a slot."""
    slots = "<Slots><Slot><Name>Axis</Name><ModuleIdent>#x77</ModuleIdent></Slot></Slots>"
    path = write(
        home / "drives.xml",
        device(1, 5, type="SERVO-5", name="Servo five"),
        device(1, 7, type="SERVO-7", name="Servo seven", entry="Actual position"),
        device(2, 1, type="COUPLER", name="Modular coupler", inner=slots),
        modules=module(0x77, "AXIS"),
    )
    call(f"esi add {path}", capsys)
    return path


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def test_add_counts_what_it_found(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(home / "a.xml", device(), modules=module(1))
    assert call(f"esi add {path}", capsys) == (0, f"{path}: 1 file, 1 device, 1 module\n", "")


def test_add_continues_after_an_error(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(home / "a.xml", device())
    (home / "empty").mkdir()
    status, out, err = call(f"esi add /nowhere.xml {home}/empty {path}", capsys)
    assert status == 1
    assert f"{path}: 1 file, 1 device" in out
    assert "catenary: /nowhere.xml: no such file or folder\n  hint: check the path\n" in err
    assert f"{home}/empty: no description found" in err


def test_add_shows_faults_with_file_and_line(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (home / "bad.xml").write_text(esi(device())[:-40])
    status, out, err = call(f"esi add {home}/bad.xml", capsys)
    assert (status, out) == (1, f"{home}/bad.xml: 1 file, 0 devices\n")
    assert f"{home}/bad.xml:20: not well-formed XML" in err
    assert "internal error" not in err


def test_an_unsafe_archive_is_refused(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with zipfile.ZipFile(home / "x.zip", "w") as opened:
        opened.writestr("../x.xml", esi(device()))
    status, out, err = call(f"esi add {home}/x.zip", capsys)
    assert (status, out) == (1, "")
    assert "x.zip: the archive is refused: member '../x.xml' would leave" in err
    assert "hint: extract it by hand" in err


def test_find_by_name(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call("esi find servo", capsys)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].split() == ["type", "name", "vendor", "product", "revision", "file"]
    assert [line.split()[0] for line in lines[1:]] == ["SERVO-5", "SERVO-7"]
    assert lines[1].endswith(f"{drives}:7")


@pytest.mark.parametrize(
    ("key", "types", "note"),
    [
        ("0x5A5A:1", ["SERVO-7", "SERVO-5"], ""),
        ("0x5A5A:1:5", ["SERVO-5"], "note: exact revision\n"),
        ("23130:1:6", ["SERVO-5"], "note: newest revision not above the device's\n"),
        ("#x5a5a:#x1:#x7", ["SERVO-7"], "note: exact revision\n"),
    ],
)
def test_find_by_numbers(
    drives: Path, capsys: pytest.CaptureFixture[str], key: str, types: list[str], note: str
) -> None:
    status, out, err = call(f"esi find {key}", capsys)
    assert (status, err) == (0, note)
    assert [line.split()[0] for line in out.splitlines()[1:]] == types


def test_find_as_json(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("esi find SERVO-5 --json", capsys)
    (found,) = json.loads(out)
    assert status == 0
    assert (found["vendor"], found["product"], found["revision"]) == (VENDOR, 1, 5)
    assert (found["file"], found["line"]) == (str(drives), 7)


@pytest.mark.parametrize(
    ("line", "message", "hint"),
    [
        ("esi find SERVO-8", "no description of SERVO-8", "did you mean SERVO-7, SERVO-5?"),
        ("esi show SERVO-8", "no description of SERVO-8", "did you mean SERVO-7, SERVO-5?"),
        ("esi find 1:2", "no description of 1:2", "catenary esi add FILE"),
        ("esi show 1:2:3", "no description of 1:2:3", "catenary esi add FILE"),
        (
            "esi find 0x5A5A:1:4",
            "only newer revisions: 0x00000007, 0x00000005",
            "add the vendor's file for this revision",
        ),
        ("esi show 0x5A5A:1:4", "only newer revisions: 0x00000007", "for this revision"),
        ("esi show r", "2 products match 'r': COUPLER 0x00005A5A", "give the numbers"),
        ("esi remove /nowhere.xml", "does not list this path", "catenary esi list --files"),
        ("esi show X --library /nowhere", "the library has no devices", "catenary esi add FILE"),
    ],
)
def test_no_result_is_an_error_with_the_next_step(
    drives: Path, capsys: pytest.CaptureFixture[str], line: str, message: str, hint: str
) -> None:
    status, out, err = call(line, capsys)
    assert (status, out) == (1, "")
    text, _, found = err.partition("\n  hint: ")
    assert message in text
    assert hint in found


def test_show_a_device(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call("esi show SERVO-7 --pdos", capsys)
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "SERVO-7 (Servo seven)"
    assert "vendor    0x00005A5A Acme" in lines
    assert f"file      {drives}:20" in lines
    assert "  0  inputs  0x1000  0 bytes  control 0x20" in lines
    assert "  TxPDO 0x1A00  SM 0  16 bits  fixed  In" in lines
    assert "    0x6000:01         16 bits  INT    Actual position" in lines


def test_show_notes_another_revision_and_modules(
    drives: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = call("esi show 0x5A5A:1:6", capsys)[1]
    assert f"{drives}:7: revision 0x00000005 is used for a device of revision 0x00000006" in out
    out = call("esi show COUPLER --pdos", capsys)[1]
    assert "  slot 0  Axis\n      0x00000077  AXIS\n" in out
    assert "PDOs of AXIS" in out


def test_show_as_json(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(call("esi show SERVO-7 --json", capsys)[1])
    assert found["key"] == {"vendor": VENDOR, "product": 1, "revision": 7}
    assert found["source"] == {"file": str(drives), "line": 20}
    assert found["pdos"][0]["direction"] == "input"
    assert found["pdos"][0]["entries"][0]["name"] == "Actual position"


def test_show_a_file_that_is_not_in_the_library(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(home / "esi/a.xml", device(type="OTHER"))
    for place in (path, path.parent):
        status, out, _ = call(f"esi show OTHER --library {place}", capsys)
        assert status == 0
        assert out.startswith("OTHER (Drive)")
    assert os.listdir(path.parent) == ["a.xml"]


def test_the_order_code_decides_between_equal_numbers(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(home / "esi/a.xml", device(type="LEFT"), device(type="RIGHT"))
    status, out, _ = call(f"esi show RIGHT --library {home}/esi", capsys)
    assert status == 0
    assert out.startswith("RIGHT (Drive)")
    assert "differently: type; " in out


def test_list_and_remove(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(call("esi list", capsys)[1].splitlines()) == 4
    assert len(json.loads(call("esi list --json", capsys)[1])) == 3
    assert call("esi list --files", capsys)[1] == f"{drives}\n  {drives}\n"
    assert json.loads(call("esi list --files --json", capsys)[1])["sources"] == [str(drives)]
    assert call(f"esi remove {drives}", capsys) == (0, f"removed {drives}\n", "")
    assert call("esi list --files", capsys) == (0, "", "")


def test_list_reports_missing_files_and_duplicates(
    drives: Path, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(home / "library/copy.xml", device(1, 5, type="SERVO-5", name="Copy"))
    status, _, err = call("esi list --check", capsys)
    assert status == 1
    assert f"{drives}:7: {home}/library/copy.xml:7 describes" in err
    assert "differently: name; " in err
    drives.unlink()
    status, out, err = call("esi list", capsys)
    assert status == 1
    assert f"{drives}: missing; add it again, or remove it" in err
    assert len(out.splitlines()) == 2


def test_names_are_escaped(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(home / "a.xml", device(type="A\u202e", name="clear\u0085screen"))
    out = call(f"esi list --library {path}", capsys)[1]
    assert "\\u202e" in out
    assert "\u202e" not in out


def test_a_closed_reader_is_not_an_error(home: Path) -> None:
    path = write(home / "many.xml", *(device(each) for each in range(3000)))
    done = subprocess.run(
        f"{sys.executable} -m catenary.cli esi list --library {path} | head -1",
        shell=True,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout.startswith("type")
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("2:0x07D43052", (2, 0x07D43052)),
        ("2:3:4", (2, 3, 4)),
        ("0x5a5a:0A:1", (0x5A5A, 0x0A, 1)),
        ("EL2004", None),
        ("2", None),
        ("2:3:4:5", None),
        ("a: b", None),
    ],
)
def test_keys(text: str, key: tuple[int, ...] | None) -> None:
    assert key_of(text) == key


def test_the_shared_files(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = shared_data / "esi"
    status, out, _ = call(f"esi list --json --library {folder}", capsys)
    assert status == 0
    for each in json.loads(out):
        name = each["type"]
        for options in ("--pdos --objects", "--json"):
            status, out, err = call(f"esi show {name!r} {options} --library {folder}", capsys)
            assert (status, err) == (0, "")
            assert name in out
