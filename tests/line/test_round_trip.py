"""A clone that is written and read is the same, byte for byte and value for value."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings

from catenary.errors import CloneError
from catenary.line import Line, read_line, write_line
from catenary.line.writer import prepare, write_device
from catenary.wire.error_counters import ErrorCounters
from tests.line.clones import LAYOUT, lines, one_device


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@given(lines())
@settings(deadline=None, max_examples=60)
def test_any_line_is_read_as_it_was_written(line: Line) -> None:
    with tempfile.TemporaryDirectory() as name:
        first, second = Path(name) / "a", Path(name) / "b"
        write_line(line, first)
        found = read_line(first)
        assert found == line
        write_line(found, second)
        assert contents(first) == contents(second)


def test_the_texts_are_as_documented(tmp_path: Path) -> None:
    write_line(Line((one_device(),)), tmp_path)
    assert sorted(contents(tmp_path)) == [
        "01-Axis_0/device.toml",
        "01-Axis_0/objects.tsv",
        "01-Axis_0/sii.bin",
        "line.toml",
    ]
    rows = (tmp_path / "01-Axis_0" / "objects.tsv").read_text().splitlines()
    assert rows[2] == "0x1018\t\tRECORD 0x0023\t4\t\tIdentity\t\t"
    assert rows[4] == "0x1018\t0x01\tUDINT\t32\trPSO w--- ----\tvendor\t02000000\t"
    assert rows[5] == "0x1018\t0x02\tUDINT\t32\trPSO w--- ----\tproduct\t\t0x06020000"
    text = (tmp_path / "01-Axis_0" / "device.toml").read_text()
    assert '    "0x6040:00 16",\n' in text
    assert "al_status = 0x0002  # AL status: PRE-OP\n" in text


def test_registers_are_decoded() -> None:
    device = one_device()
    assert device.error_counters == ErrorCounters()
    assert len(device.sync_managers) == 2
    assert device.value(0x1018, 1) == b"\x02\x00\x00\x00"
    assert device.value(0x1018, 9) is None
    assert device.mailbox == LAYOUT


def test_a_second_clone_replaces_the_first(tmp_path: Path) -> None:
    write_line(Line((one_device(0), one_device(1))), tmp_path)
    write_line(Line((one_device(0, name="Other"),)), tmp_path)
    assert [each.name for each in read_line(tmp_path).devices] == ["Other"]
    assert {path.name for path in tmp_path.iterdir()} == {"line.toml", "01-Other"}


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(CloneError, match="other files than a clone: thesis"):
        write_line(Line((one_device(),)), tmp_path)
    assert (tmp_path / "thesis.tex").exists()


def test_a_half_written_folder_is_no_clone(tmp_path: Path) -> None:
    prepare(tmp_path)
    write_device(one_device(), tmp_path)
    with pytest.raises(CloneError, match=r"line\.toml: the file is missing") as error:
        read_line(tmp_path)
    assert "continues" in error.value.hint
