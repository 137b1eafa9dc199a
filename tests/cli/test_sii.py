"""`sii read` and `sii write` on a virtual segment that several commands share."""

from __future__ import annotations

import shlex
import struct
from pathlib import Path

import pytest

import catenary as cat
from catenary.cli.main import main
from catenary.cli.sii import as_text, dump
from catenary.cli.sii_text import differences, word_differences
from catenary.errors import DecodeError
from catenary.wire.sii import Category, Header, Sii, checksum_of
from catenary.wire.sii_categories import (
    ClockMode,
    General,
    Pdo,
    PdoEntry,
    encode_clock_modes,
    encode_pdos,
    encode_strings,
)


@pytest.fixture
def segment(monkeypatch: pytest.MonkeyPatch) -> cat.Segment:
    segment = cat.Segment(
        [cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.Servo(name="wrist", serial=7)]
    )
    monkeypatch.setattr("catenary.target.main_device.parse", lambda _: segment)
    return segment


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(shlex.split(line))
    printed = capsys.readouterr()
    return status, printed.out, printed.err


def spoil(segment: cat.Segment, position: int, *words: tuple[int, int]) -> None:
    from catenary.procedure.sii_write import Change, write_words

    with cat.MainDevice(segment) as opened:
        station = opened.passive_scan(names=False)[position].station
        opened.converse(write_words(station, [Change(*each) for each in words]))


def test_read_returns_the_content(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "servo.bin"
    assert call(f"sii read eth9 1 -o {path}", capsys) == (0, "", "")
    assert path.read_bytes() == segment.core.sii_image(1)


def test_text_explains_the_fields(segment: cat.Segment, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call("sii read eth9 2 --text", capsys)
    lines = out.splitlines()
    assert status == 0
    assert "serial 7" in lines
    assert "name 'wrist'" in lines
    assert (
        "SyncManager 2: 13 bytes at 0x1100, control 0x64, status 0x00, enable 0x01 (ENABLED), "
        "use 3 (OUTPUTS)" in lines
    )
    assert "RxPDO 0x1600   0x6040:00 16 bits UINT 'Controlword'" in lines


def test_the_dump_omits_repeated_lines() -> None:
    assert dump(b"EtherCAT" * 2 + bytes(64)) == [
        "000000  45 74 68 65 72 43 41 54 45 74 68 65 72 43 41 54  EtherCATEtherCAT",
        "000010  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00  ................",
        "*",
        "000050",
    ]


def test_write_shows_the_differences_and_verifies(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrist.bin"
    call(f"sii read eth9 2 -o {path}", capsys)
    status, out, _ = call(f"sii write eth9 1 {path} --dry-run", capsys)
    assert status == 0
    assert "-serial 0\n+serial 7\n" in out
    assert "-name 'Catenary virtual servo'\n+name 'wrist'\n" in out
    assert segment.core.sii_image(1) != path.read_bytes()
    status, out, _ = call(f"sii write eth9 1 {path}", capsys)
    assert status == 0
    assert out.endswith("words written and verified; power-cycle the device to use them\n")
    assert segment.core.sii_image(1) == path.read_bytes()
    assert call(f"sii write eth9 1 {path}", capsys)[1].endswith("already has this content\n")


def test_a_wrong_checksum_is_reported_and_can_be_repaired(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "servo.bin"
    call(f"sii read eth9 1 -o {path}", capsys)
    spoil(segment, 1, (7, 0))
    status, out, err = call("sii read eth9 1 --text", capsys)
    assert status == 1
    assert "serial 0" in out
    assert "device 1: SII: checksum 0x0000, expected 0x" in err
    assert call(f"sii write eth9 1 {path}", capsys)[0] == 0
    assert call("sii read eth9 1 --text", capsys)[0] == 0


def test_categories_without_an_end_are_reported(
    segment: cat.Segment, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil(segment, 1, *((word, 0) for word in range(8)), *((w, 0) for w in range(0x40, 0xC0)))
    status, out, err = call("sii read eth9 1", capsys)
    assert status == 1
    assert out.splitlines()[-1] == "001000"
    assert "no end mark, 4096 bytes are used" in err


def test_an_image_for_another_product_needs_force(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "coupler.bin"
    call(f"sii read eth9 0 -o {path}", capsys)
    before = segment.core.sii_image(1)
    status, _, err = call(f"sii write eth9 1 {path}", capsys)
    assert status == 1
    assert "check POSITION; --force changes the device's identity" in err
    assert segment.core.sii_image(1) == before
    assert call(f"sii write eth9 1 {path} --force", capsys)[0] == 0
    assert segment.core.sii_image(1) == path.read_bytes()


def test_a_wrong_checksum_is_refused_even_with_force(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "edited.bin"
    image = bytearray(segment.core.sii_image(1))
    image[8] = 5  # the alias
    path.write_bytes(image)
    status, _, err = call(f"sii write eth9 1 {path} --force", capsys)
    assert status == 1
    assert f"write 0x{checksum_of(bytes(image)):02X} to byte 14" in err


def test_an_image_larger_than_the_eeprom_is_refused(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "large.bin"
    image = bytearray(segment.core.sii_image(1).ljust(4096, b"\x55"))
    image[0x7C] = 31  # 32 kbit
    path.write_bytes(image)
    status, _, err = call(f"sii write eth9 1 {path}", capsys)
    assert status == 1
    assert "the image has 4096 bytes, but the EEPROM has only 2048 bytes" in err
    status, _, err = call(f"sii write eth9 1 {path} --force", capsys)
    assert status == 1
    assert "SII word 0x0400 cannot be set to 0x5555: the EEPROM does not acknowledge" in err
    assert "mixture of old and new" in err


def test_show_prints_every_field(
    segment: cat.Segment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "oversampled.bin"
    path.write_bytes(oversampled_image())
    status, out, err = call(f"sii show {path}", capsys)
    assert (status, err) == (0, "")
    for line in (
        "flags 0x12: NO_LRW, IDENTIFICATION_BY_MEMORY",
        "identification at 0x0012",
        "TxPDO 0x1A00 'Samples': SyncManager 3, synchronisation 1, "
        "flags 0x0011 (MANDATORY, FIXED_CONTENT)",
        "TxPDO 0x1A00   0x6000:01 16 bits INT 'Value', flags 0x0002",
        "TxPDO 0x1A00   0x6000:02 3 bits type 0x77 'Value'",
        "OpMode 0 'DcSync4': AssignActivate 0x0730",
        "OpMode 0 'DcSync4': SYNC0 cycle 0 ns, factor -4, shift -10000 ns",
        "OpMode 0 'DcSync4': SYNC1 factor -1, shift 1000 ns",
        "OpMode 0 'DcSync4': description 'Value'",
        "category 2049, +0x0000: 01 02",
        "after the categories: 2 bytes of ff",
    ):
        assert line in out.splitlines()


def oversampled_image() -> bytes:
    """Image with the clocks of Beckhoff's EL3702 (ESI, OpMode DcSync4) and all kinds of fields."""
    strings = encode_strings(["DcSync4", "Samples", "Value"])
    entries = (
        PdoEntry(0x6000, 1, 16, data_type=0x03, name=3, flags=2),
        PdoEntry(0x6000, 2, 3, data_type=0x77, name=3),
    )
    pdo = Pdo(0x1A00, entries, sync_manager=3, synchronization=1, name=2, flags=0x11)
    mode = ClockMode(
        shift_time_ns=-10_000,
        shift_time_1_ns=1_000,
        sync1_factor=-1,
        assign_activate=0x0730,
        sync0_factor=-4,
        name=1,
        description=3,
    )
    general = General(flags=0x12, identification_address=0x12)
    return Sii(
        Header(2, 3, 4),
        (
            Category(10, strings),
            Category(30, general.encode()),
            Category(50, encode_pdos([pdo])),
            Category(60, encode_clock_modes([mode])),
            Category(0x801, b"\x01\x02"),
        ),
    ).encode()


def test_show_reports_an_invalid_image(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "drive.hex"
    path.write_text(":020000040000FA\n")
    status, out, err = call(f"sii show {path}", capsys)
    assert status == 1
    assert "invalid image" in out
    assert "the header alone needs" in err
    assert "convert Intel hex" in err


def test_every_byte_that_differs_is_shown() -> None:
    """Every difference has a line: a flag, a factor, or padding after a string."""
    image = oversampled_image()
    for place in range(len(image)):
        for bit in (1, 0x80):
            other = bytearray(image)
            other[place] ^= bit
            try:
                assert differences(image, bytes(other)), place
            except DecodeError:
                assert word_differences(image, bytes(other))


@pytest.mark.parametrize(
    ("place", "lines"),
    [
        (
            "flags",
            [
                "-flags 0x12: NO_LRW, IDENTIFICATION_BY_MEMORY",
                "+flags 0x10: IDENTIFICATION_BY_MEMORY",
            ],
        ),
        (
            "factor",
            [
                "-OpMode 0 'DcSync4': SYNC1 factor -1, shift 1000 ns",
                "+OpMode 0 'DcSync4': SYNC1 factor 1, shift 1000 ns",
            ],
        ),
    ],
)
def test_differences_name_the_field(place: str, lines: list[str]) -> None:
    image = oversampled_image()
    other = bytearray(image)
    if place == "flags":
        other[image.index(General(flags=0x12, identification_address=0x12).encode()) + 11] = 0x10
    else:
        start = image.index(struct.pack("<ii", -10_000, 1_000))
        other[start + 8 : start + 10] = struct.pack("<h", 1)
    assert differences(image, bytes(other)) == lines


def test_real_images_are_shown_completely(shared_data: Path) -> None:
    for path in sorted((shared_data / "sii").glob("*.bin")):
        lines = as_text(path.read_bytes())
        assert len(lines) > 10 or "empty" in path.name


@pytest.mark.parametrize(
    ("line", "status", "message"),
    [
        ("sii read virtual 6", 2, "the segment has 6"),
        ("sii write virtual 1 /nowhere.bin", 1, "/nowhere.bin: No such file"),
        ("sii write virtual 1 /dev/null", 1, "0 bytes: the header alone needs"),
        ("sii show /nowhere.bin", 1, "/nowhere.bin: No such file"),
    ],
)
def test_errors_name_the_cause(
    line: str, status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found, out, err = call(line, capsys)
    assert (found, out) == (status, "")
    assert message in err
    assert "internal error" not in err
