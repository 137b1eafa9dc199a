"""Folders that were edited, half written or forged: errors name the file and the line."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from catenary.errors import CloneError
from catenary.line import Line, read_line, write_line
from catenary.line.files import LIMITS
from tests.line.clones import one_device

TEXTS = ("line.toml", "01-Axis_0/device.toml", "01-Axis_0/objects.tsv", "02-Axis_1/device.toml")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_line(Line((one_device(0), one_device(1))), tmp_path / "line")
    return tmp_path / "line"


def edit(path: Path, old: str, new: str) -> int:
    """Replace a text in a file. Return its line."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return text[: text.index(old)].count("\n") + 1


DEVICE, OBJECTS = "01-Axis_0/device.toml", "01-Axis_0/objects.tsv"


@pytest.mark.parametrize(
    ("file", "old", "new", "reason"),
    [
        ("line.toml", "format = 1", "format = 2", "format 2 cannot be read"),
        ("line.toml", "format = 1", "format 1", "not TOML"),
        ("line.toml", "serials = true", "serials = 1", "serials must be true or false"),
        ("line.toml", "complete = true", "complete = false", "complete must be true if"),
        ("line.toml", '"01-Axis_0"', '"../secret"', "is not a folder of a device"),
        ("line.toml", '"01-Axis_0"', '"01-.."', "is not a folder of a device"),
        ("line.toml", '"01-Axis_0"', '"02-Axis_1"', "must begin with 01"),
        ("line.toml", "vendor = 0x00000002", "vendor = 0x00000003", "vendor differs"),
        ("line.toml", 'name = "Axis 0"', 'name = "Axis"', "name differs"),
        ("line.toml", "parent = 0", "parent = 1", "parent differs"),
        ("line.toml", "notes = []", "colour = 1", "unknown key 'colour'"),
        (DEVICE, "alias = 0x0007", "alias = 0x10007", "out of range"),
        (DEVICE, "alias = 0x0007", 'alias = "7"', "alias must be an integer, not str"),
        (DEVICE, "raised = true\n", "", "key 'raised' is missing"),
        (DEVICE, 'source = "CoE"', 'source = "IgH"', "is unknown"),
        (DEVICE, '"0x6040:00 16"', '"0x6040 16"', "is not an entry"),
        (DEVICE, "0x0110 =", "0x9999 =", "up to 0x0FFF"),
        (DEVICE, "0x0110 =", "dl_status =", "is not an address"),
        (DEVICE, '0x0110 = "00 00"', '0x0110 = "00"', "is not a known register"),
        (DEVICE, '0x0110 = "00 00"', '0x0110 = "0g"', "not hexadecimal"),
        (DEVICE, '0x0110 = "00 00"', '0x0001 = "00"', "overlaps the line before"),
        (OBJECTS, "RECORD", "TABLE", "unknown object code"),
        (OBJECTS, "0x1018\t0x01\tUDINT", "0x1018\t0x01\tUDINTS", "unknown data type"),
        (OBJECTS, "0x1018\t0x01", "0x1018\t0x00", "not ascending"),
        (OBJECTS, "0x1018\t0x01", "0x1017\t0x01", "without a line of its object"),
        (OBJECTS, "02000000", "0200000", "not hexadecimal"),
        (OBJECTS, "rPSO w---", "rw", "access 'rw"),
        (OBJECTS, "vendor\t", "vendor ", "7 fields, expected 8"),
        (OBJECTS, "index\t", "", "the first line must be the headings"),
        (OBJECTS, "a\\t", "a\\q", "unknown escape"),
    ],
)
def test_an_edited_line_is_named(folder: Path, file: str, old: str, new: str, reason: str) -> None:
    line = edit(folder / file, old, new)
    with pytest.raises(CloneError, match=reason) as error:
        read_line(folder)
    assert error.value.file == str(folder / file)
    if "is missing" not in reason:  # then the whole table
        assert error.value.line == line
    assert error.value.hint


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("line.toml", "not a finished clone"),
        (DEVICE, "No such file"),
        ("01-Axis_0/sii.bin", "sii.bin is missing, without a reason"),
        (OBJECTS, "objects.tsv is missing, without a reason"),
    ],
)
def test_a_missing_file_is_named(folder: Path, file: str, reason: str) -> None:
    (folder / file).unlink()
    with pytest.raises(CloneError, match=reason):
        read_line(folder)


def link_out(path: Path) -> None:
    path.rename(path.with_name("outside"))
    path.symlink_to(path.with_name("outside"))


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def huge(path: Path) -> None:
    with open(path, "r+b") as file:
        file.truncate(LIMITS[path.name] + 1)  # sparse


def binary(path: Path) -> None:
    path.write_bytes(b"format = 1\n\xff\n")


@pytest.mark.parametrize("file", ["line.toml", DEVICE, OBJECTS, "01-Axis_0/sii.bin"])
@pytest.mark.parametrize(
    ("forge", "reason"),
    [
        (link_out, "a symbolic link"),
        (pipe, "not a regular file"),
        (huge, "more than [0-9]+ bytes"),
    ],
)
def test_forged_files_are_refused(
    folder: Path, file: str, forge: Callable[[Path], None], reason: str
) -> None:
    forge(folder / file)
    with pytest.raises(CloneError, match=reason) as error:
        read_line(folder)
    assert error.value.file == str(folder / file)


def test_a_linked_folder_of_a_device_is_refused(folder: Path) -> None:
    link_out(folder / "01-Axis_0")
    with pytest.raises(CloneError, match="a symbolic link"):
        read_line(folder)


def test_text_that_is_not_utf_8_has_a_line(folder: Path) -> None:
    binary(folder / "line.toml")
    with pytest.raises(CloneError, match="not UTF-8") as error:
        read_line(folder)
    assert error.value.line == 2


def test_deep_nesting_and_truncation_are_errors(folder: Path) -> None:
    path = folder / OBJECTS
    path.write_text(path.read_text().removesuffix("\n"))
    with pytest.raises(CloneError, match="last line is not complete"):
        read_line(folder)
    (folder / "line.toml").write_text("format = " + "[" * 100_000)
    with pytest.raises(CloneError, match=r"nested too deeply|not TOML"):
        read_line(folder)


def test_a_folder_of_no_clone(tmp_path: Path) -> None:
    with pytest.raises(CloneError, match="No such file"):
        read_line(tmp_path / "absent")
    (tmp_path / "file").touch()
    with pytest.raises(CloneError, match="not a folder"):
        read_line(tmp_path / "file")


@given(
    file=st.sampled_from(TEXTS),
    at=st.floats(0, 1),
    removed=st.integers(0, 40),
    added=st.binary(max_size=12) | st.sampled_from([b"\t", b"\n", b'"', b"0x", b"[", b"="]),
)
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_edit_is_read_or_refused_with_a_place(
    folder: Path, file: str, at: float, removed: int, added: bytes
) -> None:
    path = folder / file
    data = path.read_bytes()
    start = int(at * len(data))
    path.write_bytes(data[:start] + added + data[start + removed :])
    error = refusal(folder)
    path.write_bytes(data)
    assert error is None or error.file.startswith(str(folder))
    assert error is None or error.hint


def refusal(folder: Path) -> CloneError | None:
    try:
        read_line(folder)
    except CloneError as error:
        return error
    return None
