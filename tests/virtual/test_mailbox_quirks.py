"""Quirks of the virtual mailbox and SII, at register level."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import AnalogInputs, MailboxQuirks, Segment, Servo, SiiQuirks, read_segment
from catenary.virtual.devices.applied import AppliedDevice
from tests.virtual.main_device import STATION, MainDevice

LIST_ALL = struct.pack("<HBxHH", 0x8000, 1, 0, 1)


def main_device(device: AppliedDevice) -> MainDevice:
    main = MainDevice(Segment([device]))
    main.number_stations()
    main.start_mailbox(STATION)
    return main


def with_quirks(**quirks: object) -> MainDevice:
    return main_device(Servo(mailbox_quirks=MailboxQuirks(**quirks)))  # type: ignore[arg-type]


def object_request(index: int) -> bytes:
    return struct.pack("<HBxHH", 0x8000, 3, 0, index)


@pytest.mark.parametrize(
    ("counter", "expected"),
    [
        ("standard", [1, 2, 3]),
        ("echoed", [1, 2, 3]),
        ("stuck", [1, 1, 1]),
        ("zero", [0, 0, 0]),
    ],
)
def test_the_counter(counter: str, expected: list[int]) -> None:
    main = with_quirks(counter=counter)
    found = []
    for _ in expected:
        main.put(STATION, struct.pack("<HBHB4x", 0x2000, 0x40, 0x1000, 0))
        answer = main.fetch(STATION)
        assert answer is not None
        found.append(answer[5] >> 4)
    assert found == expected


def test_an_echoed_counter_is_the_requests() -> None:
    main = with_quirks(counter="echoed")
    main._counter = 4
    main.put(STATION, struct.pack("<HBHB4x", 0x2000, 0x40, 0x1000, 0))
    answer = main.fetch(STATION)
    assert answer is not None
    assert answer[5] >> 4 == 5


def test_aborts_of_sdo_information_without_their_code() -> None:
    assert with_quirks().ask(STATION, object_request(0x5FFF))[6:] == struct.pack("<I", 0x0602_0000)
    assert with_quirks(uncounted_aborts=True).ask(STATION, object_request(0x5FFF))[6:] == b""


def test_a_list_cut_short() -> None:
    whole = with_quirks().ask(STATION, LIST_ALL)
    assert struct.unpack_from("<H", whole, 4)[0] == 1  # one fragment follows
    missing = with_quirks(object_list="missing").ask(STATION, LIST_ALL)
    assert missing[6:] == whole[6:]
    assert struct.unpack_from("<H", missing, 4)[0] == 0
    main = with_quirks(object_list="promised")
    assert main.ask(STATION, LIST_ALL) == whole
    assert main.fetch(STATION) is None


def test_descriptions_malformed_and_missing() -> None:
    main = with_quirks(malformed_descriptions=(0x1008,), missing_descriptions=(0x1009,))
    assert len(main.ask(STATION, object_request(0x1008))) == 8
    assert len(main.ask(STATION, object_request(0x1000))) > 12
    main.put(STATION, object_request(0x1009))
    assert main.fetch(STATION) is None


@pytest.mark.parametrize(("kind", "size"), [("unsupported", 4), ("short", 2)])
def test_mailbox_errors(kind: str, size: int) -> None:
    main = with_quirks(error_reply=kind)
    main.put(STATION, LIST_ALL)
    answer = main.fetch(STATION)
    assert answer is not None
    assert (answer[5] & 0xF, answer[6:]) == (0, b"\x01\x00\x02\x00"[:size])


def test_uploads_with_one_byte_per_segment() -> None:
    main = with_quirks(drip=True)
    assert main.upload(STATION, 0x2100, 0) == bytes(k * 7 & 0xFF for k in range(2048))


def test_every_name_has_the_prefix() -> None:
    main = with_quirks(text_prefix="\x1b[2J")
    assert main.ask(STATION, object_request(0x1000))[12:] == b"\x1b[2JDevice type"
    assert main.upload(STATION, 0x1008, 0) == b"\x1b[2JCatenary virtual servo"


def test_quirks_of_analogue_inputs() -> None:
    main = main_device(AnalogInputs(mailbox_quirks=MailboxQuirks(counter="stuck")))
    for _ in range(2):
        main.put(STATION, LIST_ALL)
        answer = main.fetch(STATION)
        assert answer is not None
        assert answer[5] >> 4 == 1


def test_quirks_are_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "segment.toml"
    path.write_text(
        '[[device]]\nkind = "servo"\nmailbox_quirks = { counter = "echoed" }\n'
        'sii_quirks = { mailbox_size = 8, pdos = "unnamed" }\n'
        '[[device]]\nkind = "analog_inputs"\nmailbox_quirks = { drip = true }\n'
    )
    servo, inputs = read_segment(path)
    assert isinstance(servo, Servo)
    assert servo.mailbox_quirks == MailboxQuirks(counter="echoed")
    assert servo.sii_quirks == SiiQuirks(mailbox_size=8, pdos="unnamed")
    assert isinstance(inputs, AnalogInputs)
    assert inputs.mailbox_quirks.drip


@pytest.mark.parametrize("quirks", ["mailbox_size = 65536", "sync_managers = 256", "pdos = 1"])
def test_invalid_quirks_are_refused(quirks: str, tmp_path: Path) -> None:
    path = tmp_path / "segment.toml"
    path.write_text(f'[[device]]\nkind = "servo"\nsii_quirks = {{ {quirks} }}\n')
    with pytest.raises(ConfigurationError, match="sii_quirks"):
        read_segment(path)
