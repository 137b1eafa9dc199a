"""`catenary check --against`: devices of a segment and their ESIs."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from catenary.bus import MainDevice
from catenary.cli.main import main
from tests.esi.esi_file import device, esi, write

SEGMENT = """
[[device]]
kind = "coupler"
[[device]]
kind = "esi"
esi = "own.xml"
"""


def call(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    status = main([str(word) for word in words])
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.fixture
def segment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return a target: a coupler, and a device that agrees with own.xml."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CATENARY_ESI", str(tmp_path / "library"))
    write(Path("own.xml"), device(1, 5))
    Path("line.toml").write_text(SEGMENT)
    return "virtual:line.toml"


def changed(path: str, old: str, new: str) -> Path:
    """Write own.xml with another fact."""
    text = Path("own.xml").read_text()
    assert old in text
    Path(path).write_text(text.replace(old, new))
    return Path(path)


def test_a_device_that_agrees_with_its_file(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(capsys, "check", segment, "--against", "own.xml")
    assert status == 0
    lines = out.splitlines()
    assert "device 0 (Catenary virtual coupler): no description of" in lines[0]
    assert lines[1].startswith("device 1 (Drive): ")
    assert lines[1].endswith("own.xml:7, exact revision: no difference")
    assert lines[2] == "1 device of 2 compared: 0 errors, 0 warnings, 0 info"


def test_an_error_changes_the_exit_status(segment: str, capsys: pytest.CaptureFixture[str]) -> None:
    changed("other.xml", "<BitLen>16</BitLen>", "<BitLen>32</BitLen>")
    status, out, _ = call(capsys, "check", segment, "--against", "other.xml")
    assert status == 1
    assert (
        "error    TxPDO 0x1A00 (In), entry 1: 0x6000:01 with 16 bits at bit 0 in the device, "
        "0x6000:01 with 32 bits at bit 0 in the ESI"
    ) in out
    assert "other.xml:15)" in out
    assert "1 device of 2 compared: 1 error, 0 warnings, 0 info" in out


def test_warnings_do_not_change_the_exit_status(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    changed("other.xml", 'RevisionNo="#x5"', 'RevisionNo="#x6"')
    status, out, _ = call(capsys, "check", segment, "--against", "other.xml", "--position", "1")
    assert status == 0
    assert "warning  revision: 0x00000005 in the device, 0x00000006 in the ESI" in out


def test_the_file_of_another_device_is_one_error(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write(Path("other.xml"), device(2, 5))
    words = ("check", segment, "--against", "other.xml", "--position", "1")
    status, out, _ = call(capsys, *words)
    assert status == 1
    assert out.count("error  ") == 1
    assert "vendor and product: 0x00005A5A:0x00000001 in the device" in out
    status, out, _ = call(capsys, *words[:-2])
    assert status == 1
    assert "0 devices of 2 compared" in out


def test_a_missing_description_of_the_chosen_device_is_an_error(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write(Path("other.xml"), device(2, 5), device(3, 5))
    status, out, _ = call(capsys, "check", segment, "--against", "other.xml", "--position", "1")
    assert status == 1
    assert "no description of 0x00005A5A:0x00000001 in" in out


def test_the_library_is_used_without_a_value(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(capsys, "check", segment, "--against")
    assert status == 1
    assert "it is empty (add the vendor's ESI file: catenary esi add FILE)" in out
    call(capsys, "esi", "add", "own.xml")
    status, out, _ = call(capsys, "check", segment, "--against")
    assert status == 0
    assert "1 device of 2 compared" in out


def test_a_folder_with_two_files_of_one_device(
    segment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "esi").mkdir()
    for name in ("a.xml", "b.xml"):
        shutil.copy("own.xml", tmp_path / "esi" / name)
    status, out, _ = call(capsys, "check", segment, "--against", "esi")
    assert status == 0
    assert "a.xml:7, exact revision: no difference" in out
    assert "note     " in out
    assert "b.xml:7 also describes it" in out


def test_json(segment: str, capsys: pytest.CaptureFixture[str]) -> None:
    changed("other.xml", 'ControlByte="#x20"', 'ControlByte="#x24"')
    status, out, _ = call(
        capsys, "check", segment, "--against", "other.xml", "--position", "1", "--json"
    )
    assert status == 1
    values = json.loads(out)
    assert values["machine"] is None
    [found] = values["devices"]
    assert (found["position"], found["esi"]["type"], found["problem"]) == (1, "DRIVE-1", "")
    [difference] = found["differences"]
    assert difference["severity"] == "error"
    assert difference["subject"] == "SyncManager"
    assert difference["what"] == "SyncManager 0, control"
    assert (difference["device"], difference["esi"]) == ("0x20", "0x24")
    assert difference["line"] == 14


def test_a_machine_file_gives_both_comparisons(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(capsys, "init", segment, "-o", "machine.toml")[0] == 0
    status, out, _ = call(capsys, "check", "machine.toml", "--against", "own.xml")
    assert status == 0
    assert out.count("\nsame ") == 2
    assert "1 device of 2 compared: 0 errors, 0 warnings, 0 info" in out
    write(Path("own.xml"), device(1, 7))  # the device of the segment is another one now
    status, out, _ = call(capsys, "check", "machine.toml", "--against", "own.xml", "--json")
    assert status == 1
    values = json.loads(out)
    assert [each["verdict"] for each in values["machine"]] == ["same", "different"]
    assert values["devices"][1]["differences"] == []


def test_the_files_of_a_machine_file_are_used_without_a_value(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(capsys, "init", segment, "-o", "machine.toml")[0] == 0
    path = Path("machine.toml")
    path.write_text(f'esi = "own.xml"\n{path.read_text()}')
    status, out, _ = call(capsys, "check", "machine.toml", "--against")
    assert status == 0
    assert "own.xml:7, exact revision: no difference" in out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--against", "missing.xml"), "missing.xml: no such file or folder"),
        (("--against", "own.xml", "--position", "7"), "there is no device 7"),
        (("--objects",), "--objects needs --against"),
        (("--position", "1"), "--position needs --against"),
    ],
)
def test_what_cannot_be_compared_gives_status_2(
    segment: str, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], text: str
) -> None:
    status, out, err = call(capsys, "check", segment, *words)
    assert (status, out) == (2, "")
    assert text in err


def test_a_broken_file_gives_status_2_with_its_line(
    segment: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("broken.xml").write_text(esi(device(1, 5))[:-200])
    status, out, err = call(capsys, "check", segment, "--against", "broken.xml")
    assert (status, out) == (2, "")
    assert "broken.xml:" in err
    assert "not well-formed XML" in err


def test_a_folder_without_files_gives_status_2(
    segment: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    status, _, err = call(capsys, "check", segment, "--against", "empty")
    assert status == 2
    assert "no device description found" in err


def test_real_files_in_a_segment(
    segment: str, shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = shared_data / "esi" / "hpm_ECAT_CIA402.xml"
    Path("line.toml").write_text(f'[[device]]\nkind = "esi"\nesi = "{path}"\n')
    status, out, _ = call(capsys, "check", segment, "--against", path, "--objects")
    assert (status, out.splitlines()[-1]) == (
        0,
        "1 device of 1 compared: 0 errors, 0 warnings, 0 info",
    )


def test_another_master_keeps_the_states(
    segment: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path("own.xml")
    mailbox = """<Mailbox><CoE SdoInfo="1"/></Mailbox>"""
    text = path.read_text().replace("</TxPdo>", f"</TxPdo>{mailbox}")
    sizes = """<Sm DefaultSize="128" StartAddress="#x1400" ControlByte="#x26">MBoxOut</Sm>
        <Sm DefaultSize="128" StartAddress="#x1480" ControlByte="#x22">MBoxIn</Sm>"""
    path.write_text(text.replace("<TxPdo ", f"{sizes}<TxPdo ", 1))
    monkeypatch.setattr(MainDevice, "other_masters", ("another program",))
    status, out, err = call(capsys, "check", segment, "--against", path)
    assert status == 0
    assert "note: another program; this command only reads" in err
    assert "was not read: another master uses the segment (another program)" in out
