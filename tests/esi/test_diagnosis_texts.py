"""Texts of diagnosis messages in ESI files."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.cli.main import main
from catenary.esi.device import EsiDevice
from catenary.esi.reader import read_esi
from tests.esi import servo_file

GOOD = """<Profile><DiagMessages>
  <DiagMessage><TextId>#x1001</TextId>
    <MessageText LcId="1031">Ausgang %d kurzgeschlossen</MessageText>
    <MessageText LcId="1033">Output %d short-circuited</MessageText></DiagMessage>
  <DiagMessage><TextId>17</TextId><MessageText>100 %% of %u</MessageText></DiagMessage>
</DiagMessages></Profile>"""
BAD = """<Profile><DiagMessages>
  <DiagMessage><MessageText>no ID</MessageText></DiagMessage>
  <DiagMessage><TextId>#x12345</TextId><MessageText>too large</MessageText></DiagMessage>
  <DiagMessage><TextId>1</TextId></DiagMessage>
  <DiagMessage><TextId>1</TextId><MessageText>second</MessageText></DiagMessage>
</DiagMessages></Profile>"""


def device(folder: Path, profile: str) -> EsiDevice:
    servo_file.write(folder, profile=profile)
    [file] = folder.glob("*.xml")
    return read_esi(file).devices[0]


def test_texts_by_id_in_the_preferred_language(tmp_path: Path) -> None:
    found = device(tmp_path, GOOD)
    assert found.diagnosis_texts == {0x1001: "Output %d short-circuited", 17: "100 %% of %u"}
    assert not [path for path in found.unknown if "Diag" in path]


def test_faulty_texts_are_warnings(tmp_path: Path) -> None:
    found = device(tmp_path, BAD)
    assert found.diagnosis_texts == {1: "second"}
    texts = [each.message for each in found.warnings]
    assert any("DiagMessage has no TextId" in each for each in texts)
    assert any("does not fit into 16 bits" in each for each in texts)


def test_esi_show_lists_the_texts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = device(tmp_path, GOOD)
    assert main(["esi", "show", str(found.key), "--library", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("diagnosis messages: 2")
    assert lines[at + 1 : at + 3] == ["  0x0011 100 %% of %u", "  0x1001 Output %d short-circuited"]
