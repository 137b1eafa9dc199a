"""SyncManager blocks."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.sync_manager import (
    INPUTS,
    MAILBOX_IN,
    MAILBOX_OUT,
    OUTPUTS,
    Activation,
    Buffering,
    Control,
    Direction,
    PdiControl,
    Status,
    SyncManager,
    decode_sync_manager,
)
from tests.wire.strategies import flag, u8, u16

controls = st.builds(
    Control, *(st.sampled_from(Buffering), st.sampled_from(Direction), flag, flag, flag)
)
blocks = st.builds(
    SyncManager, *(u16, u16, controls, u8.map(Status), u8.map(Activation), u8.map(PdiControl))
)


def test_golden_block():
    # ethercrab's tests/replay-dc.pcapng, frame 2380: outputs of an EL2828
    block = bytes.fromhex("000f010044000100")
    control = Control(Buffering.THREE_BUFFERS, Direction.WRITE, watchdog=True)
    assert decode_sync_manager(block) == SyncManager(0x0F00, 1, control)
    assert SyncManager(0x0F00, 1, control).encode() == block


def test_the_four_usual_controls():
    # SII of metalmusings_EaserCAT_2000 in shared/data: 0x26, 0x22; the other two as most images
    usual = (MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS)
    assert [each.byte for each in usual] == [0x26, 0x22, 0x64, 0x20]


@given(blocks)
def test_round_trip(block):
    assert decode_sync_manager(block.encode()) == block


@given(u8)
def test_a_control_byte_gives_a_value_or_decode_error(byte):
    if byte & 3 in (0, 2) and byte >> 2 & 3 in (0, 1):
        assert Control.from_byte(byte).byte == byte & 0x7F
    else:
        with pytest.raises(DecodeError, match=f"0x{byte:02X}"):
            Control.from_byte(byte)


def test_wrong_lengths_and_values_are_refused():
    with pytest.raises(DecodeError, match="needs 8"):
        decode_sync_manager(bytes(7))
    with pytest.raises(ValueError, match="SyncManager"):
        SyncManager(0x10000, 0, INPUTS).encode()
