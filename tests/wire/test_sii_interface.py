"""SII control/status."""

from __future__ import annotations

import pytest
from hypothesis import given

from catenary.errors import DecodeError
from catenary.wire.sii_interface import ControlStatus, SiiCommand
from tests.wire.strategies import u16


def test_a_busy_interface_with_eight_byte_reads():
    status = ControlStatus.from_word(0x8140)
    assert status == ControlStatus(SiiCommand.READ, eight_bytes=True, busy=True)
    assert status.read_size == 8
    assert not status.failed


def test_commands_as_masters_write_them():
    assert ControlStatus(SiiCommand.READ).word == 0x0100
    assert ControlStatus(SiiCommand.WRITE, write_enable=True).word == 0x0201
    assert ControlStatus(SiiCommand.RELOAD).word == 0x0400
    assert ControlStatus().word == 0


@pytest.mark.parametrize("word", [0x2100, 0x4200])
def test_errors(word):
    assert ControlStatus.from_word(word).failed


@given(u16)
def test_every_word_gives_a_value_or_decode_error(word):
    if word >> 8 & 7 in list(SiiCommand):
        assert ControlStatus.from_word(word).word == word & ~0x001E
    else:
        with pytest.raises(DecodeError, match="invalid command"):
            ControlStatus.from_word(word)
