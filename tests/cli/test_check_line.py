"""`catenary check --against` with clones and machine files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import catenary as cat
from catenary.cli.check_roles import as_text
from catenary.cli.main import main
from catenary.machine import Comparison

SEGMENT = """
[[device]]
kind = "coupler"
[[device]]
kind = "servo"
serial = 7
[[device]]
kind = "digital_outputs"
"""
TARGET = "virtual:cell.toml"


def call(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = main([*words])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.fixture
def line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a clone of `TARGET`."""
    monkeypatch.chdir(tmp_path)
    Path("cell.toml").write_text(SEGMENT)
    cat.clone(TARGET, "line", pre_op=True)
    return Path("line")


def edit(path: Path, old: str, new: str) -> int:
    """Replace a text that occurs once, and return its line."""
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return text[: text.index(old)].count("\n") + 1


def test_an_unchanged_segment(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "check", TARGET, "--against", "line/", "--pre-op")
    assert (status, out) == (0, "3 devices compared: as in line/\n")


def test_objects_that_cannot_be_compared_give_status_2(
    line: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(capsys, "check", TARGET, "--against", "line/")
    assert status == 2
    assert out.startswith("not compared: device 1 (Catenary virtual servo): objects: not read")
    assert "3 devices compared: as in line/; not everything could be compared" in out
    assert "next: to compare the objects of devices in INIT, add --pre-op" in out


def test_a_changed_value_is_named_with_the_command_that_restores_it(
    line: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    [objects] = line.glob("02-*/objects.tsv")
    edit(objects, "Following error window\t00000400", "Following error window\te8030000")
    status, out, _ = call(capsys, "check", TARGET, "--against", "line/", "--pre-op")
    assert status == 1
    assert out.splitlines() == [
        "device 1 (Catenary virtual servo)",
        "  effect    object 0x6065:00 Following error window       1000 → 262144",
        "3 devices compared: 1 change with an effect, 0 faults, 0 info",
        "  next: write the earlier value: "
        f"catenary sdo write {TARGET} 1 0x6065:0 1000 --type UDINT",
        "  next: if everything is as intended, replace the clone: "
        f"catenary clone {TARGET} -o line/ --fresh --pre-op",
    ]


def test_an_exchanged_device(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("cell.toml").write_text(SEGMENT.replace("serial = 7", "serial = 8\nalias = 3"))
    status, out, _ = call(capsys, "check", TARGET, "--against", "line/", "--pre-op")
    assert status == 1
    assert re.search(r"effect +serial +7 → 8\n +the device was exchanged\n", out)
    assert f"next: write the earlier value: catenary alias {TARGET} 1 0" in out


def test_a_missing_device(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("cell.toml").write_text(SEGMENT[: SEGMENT.rindex("[[device]]")])
    status, out, _ = call(capsys, "check", TARGET, "--against", "line/", "--pre-op")
    assert status == 1
    assert out.startswith("earlier device 2 (Catenary virtual 4-channel output)\n  effect ")
    assert "it was behind device 1 (Catenary virtual servo) port 1" in out
    assert "next: check cable and power of the missing devices" in out


def test_two_clones(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cat.clone(TARGET, "other", pre_op=True)
    assert call(capsys, "check", "line/", "--against", "other/")[:2] == (
        *(0, "3 devices compared: as in other/\n"),
    )
    [objects] = Path("other").glob("02-*/objects.tsv")
    edit(objects, "Following error window\t00000400", "Following error window\te8030000")
    status, out, _ = call(capsys, "check", "line", "--against", "other", "--json")
    assert status == 1
    found = json.loads(out)
    assert (found["different"], found["compared"], found["not_compared"]) == (True, 3, [])
    [change] = found["changes"]
    assert change == {
        "device": {"name": "Catenary virtual servo", "old_position": 1, "position": 1},
        "part": "object",
        "what": "0x6065:00 Following error window",
        "index": 0x6065,
        "subindex": 0,
        "old": "1000",
        "new": "262144",
        "severity": "effect",
        "note": "",
    }


def test_process_values_are_listed_with_all(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cat.clone(TARGET, "other", pre_op=True)
    [objects] = Path("other").glob("02-*/objects.tsv")
    text = objects.read_text()
    found = re.search(r"^0x6064\t0x00\t.*\t([0-9a-f]{8})\t$", text, re.MULTILINE)
    assert found is not None
    objects.write_text(text[: found.start(1)] + "01020304" + text[found.end(1) :])
    status, out, _ = call(capsys, "check", "line", "--against", "other")
    assert status == 0
    assert "as in other; --all shows 1 more" in out
    status, out, _ = call(capsys, "check", "line", "--against", "other", "--all")
    assert status == 0
    assert re.search(r"variable +object 0x6064:00 .* 67305985 → 0\n", out)


@pytest.mark.parametrize(
    ("file", "old", "new", "text"),
    [
        ("objects.tsv", "\t00000400", "\t0000040", "non-hexadecimal"),
        ("objects.tsv", "VAR UDINT\t0\t\tFollowing error window", "VAR", "fields, expected 8"),
        ("device.toml", "position = 1", "position = ", "not TOML"),
        ("device.toml", "[identity]", "[identitiy]", "unknown key 'identitiy'"),
    ],
)
def test_a_clone_with_a_mistake_gives_status_2_with_file_and_line(
    line: Path, capsys: pytest.CaptureFixture[str], file: str, old: str, new: str, text: str
) -> None:
    [path] = line.glob(f"02-*/{file}")
    content = path.read_text()
    place = content.index(old)
    path.write_text(content[:place] + new + content[place + len(old) :])
    number = content[:place].count("\n") + 1
    for words in ((TARGET, "--against", "line"), ("line", "--against", "line")):
        status, out, err = call(capsys, "check", *words)
        assert (status, out) == (2, "")
        assert f"{path}:{number}: " in err
        assert text in err


def test_an_interrupted_clone_gives_status_2(
    line: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (line / "line.toml").unlink()
    status, out, err = call(capsys, "check", TARGET, "--against", "line")
    assert (status, out) == (2, "")
    assert "not a finished clone" in err


def test_a_folder_of_esis_is_not_a_clone(line: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("esi").mkdir()
    status, out, err = call(capsys, "check", TARGET, "--against", "esi")
    assert (status, out) == (2, "")
    assert "no device description found" in err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("line",), "line is a folder: it is compared with a clone or a machine file"),
        (("line", "--against", "drive.xml"), "line is a folder"),
        (("line", "virtual", "--against", "line"), "a clone has no target"),
        (("line", "--against", "line", "--pre-op"), "--pre-op needs a segment"),
        ((TARGET, "--against", "line", "--passive"), "--passive needs --against with an ESI"),
        ((TARGET, "--against", "cell.xml", "--all"), "--all needs --against with a clone"),
        (("machine.toml", "--pre-op"), "--pre-op needs --against with a clone"),
    ],
)
def test_options_of_another_comparison(
    line: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], text: str
) -> None:
    status, out, err = call(capsys, "check", *words)
    assert (status, out) == (2, "")
    assert text in err


# -- machine files ---------------------------------------------------------------------------------


@pytest.fixture
def machine(line: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Return a machine file of `TARGET`: `drives.axes` needs device 1."""
    assert call(capsys, "init", TARGET, "-o", "machine.toml")[0] == 0
    path = Path("machine.toml")
    edit(path, "# counts_per_turn", "counts_per_turn")
    return path


def test_a_machine_file_and_a_segment(machine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "check", TARGET, "--against", "machine.toml")
    assert status == 0
    assert out.count("\nsame ") == 3
    assert out.endswith("3 devices as in machine.toml\n")


def test_another_product_names_the_roles_that_need_the_device(
    machine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(machine, "product = 0x50001", "product = 0x50002")
    for found in (TARGET, "line"):
        status, out, _ = call(capsys, "check", found, "--against", "machine.toml")
        assert status == 1
        assert "product 0x00050002" in out
        assert "cvs001 is different: it is needed by drives.axes\n" in out
        assert out.endswith("1 of 3 devices differ\n")
        status, out, _ = call(capsys, "check", found, "--against", "machine.toml", "--json")
        values = json.loads(out)
        assert [each["verdict"] for each in values] == ["same", "different", "same"]
        assert [each["roles"] for each in values] == [[], ["drives.axes"], ["process_data.cvo004"]]


def test_the_machine_file_of_a_clone_without_serial_numbers(
    machine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(machine, "product = 0x50001", "product = 0x50001, serial = 8")
    assert call(capsys, "check", "line", "--against", "machine.toml")[0] == 1
    cat.clone(TARGET, "plain", pre_op=True, serials=False)
    assert call(capsys, "check", "plain", "--against", "machine.toml")[0] == 0


def test_a_machine_file_gives_the_target_of_a_clone(
    machine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("check", "machine.toml", "--against", "line", "--pre-op")
    assert call(capsys, *words)[:2] == (0, "3 devices compared: as in line\n")


def test_one_device_is_not_called_devices() -> None:
    assert as_text([Comparison("absent")], {}, "machine.toml").endswith(
        "\n1 device as in machine.toml"
    )
