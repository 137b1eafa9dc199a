"""Read access to a simulated EEPROM with real images."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from catenary.errors import EepromError
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.sii import read_image
from catenary.wire.sii import decode_sii
from tests.procedure.player import STATION, play

STRINGS_BODY = bytes([1, 250]) + bytes(range(1, 251)) + bytes(244)
ONE_LONG_CATEGORY = (
    bytes(128) + struct.pack("<HH", 10, len(STRINGS_BODY) // 2) + STRINGS_BODY + b"\xff\xff"
)
READ, BUSY, ERROR, EIGHT = 0x0100, 0x8000, 0x2000, 0x0040


class Eeprom:
    """Owner of an image that is accessed through registers 0x0502 to 0x050F."""

    def __init__(self, image: bytes, *, eight: bool, busy_for: int = 0) -> None:
        self.image = image
        self.size = 8 if eight else 4
        self.busy_for = busy_for
        self.fails = 0
        self.reads = 0
        self.loses: set[int] = set()  # numbers of read commands whose frame is lost on the way back
        self.slow: set[int] = set()  # numbers of read commands that take one poll longer
        self._busy = 0
        self._word = 0
        self._error = False
        self._losing = False

    def __call__(self, request: Request) -> Reply:
        """Answer a request. A lost frame has still reached the device."""
        is_fetch = len(request.data) != 6
        if is_fetch:
            self._losing = not request.repeatable and self.reads in self.loses
        reply = self._answer(request)
        return Reply(b"", 0, lost=True) if self._losing and not request.repeatable else reply

    def _answer(self, request: Request) -> Reply:
        assert request.address >> 16 == 0x0502
        if len(request.data) == 6:
            command, self._word = struct.unpack("<HI", request.data)
            if command == READ:
                self.reads += 1
                if self._busy:
                    return Reply(request.data, 0)
                self._busy = self.busy_for + (self.reads in self.slow)
                self._error, self.fails = self.fails > 0, max(self.fails - 1, 0)
            else:
                self._error = False
            return Reply(request.data, 1)
        status = EIGHT if self.size == 8 else 0
        if self._busy:
            self._busy -= 1
            return Reply(struct.pack("<HI8x", status | BUSY | READ, self._word), 1)
        status |= ERROR if self._error else 0
        data = self.image[2 * self._word :][: self.size].ljust(self.size, b"\xff")
        return Reply(struct.pack("<HI8s", status, self._word, data), 1)


@pytest.mark.parametrize("eight", [False, True])
@pytest.mark.parametrize(
    "name", ["beckhoff_ek1100", "beckhoff_el2889", "metalmusings_EaserCAT_6000", "pollen_Orbita2d"]
)
def test_a_real_image_is_read_completely(shared_data: Path, name: str, eight: bool) -> None:
    image = (shared_data / "sii" / f"{name}.bin").read_bytes()
    read = decode_sii(play(read_image(STATION), Eeprom(image, eight=eight)))
    whole = decode_sii(image)
    assert (read.header.vendor, read.header.product) == (whole.header.vendor, whole.header.product)
    assert read.header.standard_receive == whole.header.standard_receive
    assert read.header.size_kbit == whole.header.size_kbit
    assert read.strings == whole.strings
    assert read.general == whole.general
    assert read.fmmus == whole.fmmus
    assert read.sync_managers == whole.sync_managers
    assert read.transmit_pdos == whole.transmit_pdos
    assert read.receive_pdos == whole.receive_pdos


def test_an_unprogrammed_eeprom_ends(shared_data: Path) -> None:
    image = (shared_data / "sii" / "empty_issue286.bin").read_bytes()
    play(read_image(STATION), Eeprom(image, eight=True), steps=2000)


def test_no_word_is_read_twice_or_without_need() -> None:
    vendor_specific = struct.pack("<HH", 0x0800, 200) + bytes(400)
    strings = struct.pack("<HH", 10, 4) + b"\x01\x05Probe\x00"
    image = bytes(128) + vendor_specific + strings + b"\xff\xff" + bytes(14)
    eeprom = Eeprom(image, eight=True)
    assert b"Probe" in play(read_image(STATION), eeprom)
    header = 4 + 3 + 1  # reads of 8 bytes: words 0x00 to 0x0F, 0x14 to 0x1F, 0x3E
    assert eeprom.reads <= header + 4


def test_busy_is_waited_out() -> None:
    image = bytes(128) + b"\xff\xff"
    play(read_image(STATION), Eeprom(image, eight=False, busy_for=5))


def test_a_few_missing_acknowledgements_are_tolerated() -> None:
    image = bytes(128) + b"\xff\xff"
    eeprom = Eeprom(image, eight=False)
    eeprom.fails = 2
    play(read_image(STATION), eeprom)
    eeprom.fails = 1_000_000
    with pytest.raises(EepromError, match=r"Probe.*SII word 0x0000"):
        play(read_image(STATION), eeprom)


@pytest.mark.parametrize("eight", [False, True])
def test_reads_from_a_fast_eeprom_are_commanded_ahead(eight: bool) -> None:
    eeprom = Eeprom(ONE_LONG_CATEGORY, eight=eight)
    frames = 0

    def counted(request: Request) -> Reply:
        nonlocal frames
        frames += request.repeatable or len(request.data) == 6
        return eeprom(request)

    assert play(read_image(STATION), counted)[:-2] == ONE_LONG_CATEGORY[:628]
    assert frames < 1.2 * eeprom.reads


@pytest.mark.parametrize("eight", [False, True])
@pytest.mark.parametrize("trouble", ["slow", "loses"])
def test_failures_of_look_ahead_reads_corrupt_no_word(trouble: str, eight: bool) -> None:
    eeprom = Eeprom(ONE_LONG_CATEGORY, eight=eight)
    getattr(eeprom, trouble).update(range(3, 200, 5))
    assert play(read_image(STATION), eeprom)[:-2] == ONE_LONG_CATEGORY[:628]


def test_an_eeprom_that_stays_busy_times_out() -> None:
    eeprom = Eeprom(bytes(128), eight=False, busy_for=1_000_000)
    with pytest.raises(EepromError, match="busy"):
        play(read_image(STATION), eeprom, steps=1000)
