"""Explanations of register contents."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.wire import register
from catenary.wire.fmmu import Fmmu
from catenary.wire.register_names import by_name
from catenary.wire.register_text import _EXPLANATIONS, explain


@pytest.mark.parametrize(
    ("name", "data", "text"),
    [
        ("AL_STATUS", b"\x08\x00", "OP"),
        ("AL_STATUS", b"\x14\x00", "SAFE-OP, with an error: see AL status code"),
        ("AL_STATUS", b"\x00\x00", "invalid EtherCAT state 0 (word 0x0000)"),
        ("AL_CONTROL", b"\x12\x00", "PRE-OP requested, error acknowledged"),
        ("SII_CONFIGURATION", b"\x01", "EEPROM assigned to the device's processor (PDI)"),
        ("SYSTEM_TIME_DIFFERENCE", b"\x05\x00\x00\x80", "-5 ns"),
        ("ACTIVATION", b"\x03", "CYCLIC_OPERATION, SYNC0"),
        ("sync manager 0", bytes(8), "off (0 bytes at 0x0000)"),
        ("LOST_LINK_COUNTERS", b"\x01\x00\x00\xff", "port 0: 1; port 1: 0; port 2: 0; port 3: 255"),
        (
            "RECEIVE_TIMES",
            b"\x01\0\0\0" * 4,
            "port 0: 1 ns; port 1: 1 ns; port 2: 1 ns; port 3: 1 ns",
        ),
    ],
)
def test_explanation(name: str, data: bytes, text: str) -> None:
    assert explain(by_name(name), data) == text


def test_explanation_of_dl_status_has_all_ports() -> None:
    # EK1100 with one terminal: link and communication on ports 0 and 1; 2 and 3 are closed
    text = explain(register.DL_STATUS, (0x5A31).to_bytes(2, "little"))
    assert text == "port 0: open; port 1: open; port 2: no link; port 3: no link; EEPROM loaded"


def test_explanation_of_an_fmmu() -> None:
    block = Fmmu(0x0001_0000, 2, 0, 7, 0x1100, 0, reads=True).encode()
    text = explain(register.fmmu(1), block)
    assert text == "16 bits of inputs: logical 0x00010000 bit 0, physical 0x1100 bit 0"


def test_a_register_with_a_plain_number_has_no_explanation() -> None:
    assert explain(register.WATCHDOG_DIVIDER, b"\xc2\x09") is None


@given(st.data())
def test_any_content_is_explained_without_an_error(data: st.DataObject) -> None:
    address, size = data.draw(st.sampled_from(sorted(_EXPLANATIONS)))
    of = next(each for each in _registers() if (each.address, each.size) == (address, size))
    text = explain(of, data.draw(st.binary(min_size=size, max_size=size)))
    assert text


def _registers() -> list[register.Register[bytes] | register.Register[int]]:
    found = [each for each in vars(register).values() if isinstance(each, register.Register)]
    found += [register.fmmu(k) for k in range(16)]
    return [*found, *(register.sync_manager(k) for k in range(16))]
