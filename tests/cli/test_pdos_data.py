"""`pdos` on a virtual segment, and `data` of a running loop."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catenary.cli.main import main
from tests.remote.programs import program

Capture = pytest.CaptureFixture[str]


def test_pdos_shows_managers_and_the_mapping(capsys: Capture) -> None:
    assert main(["pdos", "virtual", "2"]) == 0
    text = capsys.readouterr().out
    assert "SM2 outputs: 0x1100, 13 bytes, control 0x64" in text
    assert "0x607A:00  Target position     DINT  32    56" in text
    assert "not assigned" not in text


def test_pdos_shows_all_devices(capsys: Capture) -> None:
    assert main(["pdos", "virtual"]) == 0
    text = capsys.readouterr().out
    assert [f"device {position} (" in text for position in range(7)] == [True] * 6 + [False]


def test_pdos_shows_unassigned_pdos_on_request(capsys: Capture) -> None:
    assert main(["pdos", "virtual", "2", "--all"]) == 0
    assert "0x1601 Axis 1 RxPDO 2: outputs, 48 bits, not assigned" in capsys.readouterr().out


def test_pdos_as_json(capsys: Capture) -> None:
    assert main(["pdos", "virtual", "2", "--all", "--json"]) == 0
    (device,) = json.loads(capsys.readouterr().out)
    assert [each["start"] for each in device["sync_managers"]] == [0x1000, 0x1080, 0x1100, 0x2000]
    first, second = device["pdos"][:2]
    assert (first["index"], first["sync_manager"], first["bits"]) == (0x1600, 2, 104)
    assert first["entries"][0] == {
        "index": 0x6040,
        "subindex": 0,
        "name": "Controlword",
        "bits": 16,
        "data_type": 6,
    }
    assert (second["index"], second["sync_manager"]) == (0x1601, None)


def test_pdos_of_a_missing_device(capsys: Capture) -> None:
    assert main(["pdos", "virtual", "9"]) == 2
    assert "there is no device 9" in capsys.readouterr().err


def test_sdo_reads_and_writes_all_subindices(capsys: Capture) -> None:
    assert main(["sdo", "read", "virtual", "2", "0x1018", "--complete"]) == 0
    assert capsys.readouterr().out.startswith("04 00 59 4e 54 43")
    write = ["sdo", "write", "virtual", "2", "0x1C12", "01000016", "--type", "BYTES", "--complete"]
    assert main([*write, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["data"] == "01000016"


def test_complete_access_begins_with_subindex_0_or_1(capsys: Capture) -> None:
    assert main(["sdo", "read", "virtual", "2", "0x1018:2", "--complete"]) == 2
    assert "subindex 0 or 1, not 2" in capsys.readouterr().err


def test_sdo_read_saves_the_bytes(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "name"
    assert main(["sdo", "read", "virtual", "2", "0x1008", "-o", str(file)]) == 0
    assert file.read_bytes() == b"Catenary virtual servo 1"
    assert capsys.readouterr().out == ""


def test_sdo_read_saves_the_bytes_and_prints_json(tmp_path: Path, capsys: Capture) -> None:
    call = ["sdo", "read", "virtual", "2", "0x1018:1", "--json", "-o"]
    assert main([*call, str(tmp_path / "vendor")]) == 0
    assert json.loads(capsys.readouterr().out)["data"] == "594e5443"
    assert (tmp_path / "vendor").read_bytes().hex() == "594e5443"
    assert main([*call, "-"]) == 2


def test_sdo_read_refuses_an_impossible_file_before_the_scan(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["sdo", "read", "no-such-interface", "2", "0x1008", "-o", str(tmp_path / "no" / "x")])
    assert caught.value.code == 2


@pytest.mark.parametrize("kind", ["BYTES", "STRING"])
def test_sdo_write_refuses_a_value_that_is_too_large(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture, kind: str
) -> None:
    import io
    import sys

    monkeypatch.setattr("catenary.cli.sdo_value.STDIN_MAX", 8)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"123456789")))
    assert main(["sdo", "write", "virtual", "2", "0x6065", "-", "--type", kind]) == 2
    assert "more than 8 bytes" in capsys.readouterr().err


def test_sdo_write_reads_text_from_stdin(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    import io
    import sys

    monkeypatch.setattr(sys, "stdin", io.StringIO("5000\n"))
    assert main(["sdo", "write", "virtual", "2", "0x6065", "-", "--type", "UDINT", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["value"] == 5000


def test_data_prints_the_newest_cycle(capsys: Capture) -> None:
    with program() as running:
        assert main(["data", running.name]) == 0
        text = capsys.readouterr().out
        assert main(["data", running.name, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
    assert text.startswith(f"{running.name}: running")
    assert found["fields"]["number"] > 0
    assert len(found["fields"]["position"]) == len(found["axes"])
    assert found["units"]["position"] == "rad"


def test_data_accepts_the_form_of_a_target(capsys: Capture) -> None:
    with program() as running:
        assert main(["data", f"share:{running.name}"]) == 0
    assert capsys.readouterr().out.startswith(f"{running.name}: running")


def test_a_command_for_a_segment_names_those_for_a_share(capsys: Capture) -> None:
    assert main(["pdos", "share:arm"]) == 1
    hint = capsys.readouterr().err
    for command in ("scan", "state", "diag", "messages", "sdo", "reg read", "shell"):
        assert command in hint


def test_data_of_a_missing_share(capsys: Capture) -> None:
    assert main(["data", "no-such-share"]) == 1
    assert "there is no share 'no-such-share'" in capsys.readouterr().err
