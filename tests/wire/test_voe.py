"""VoE: the header of vendor-specific messages. Wireshark has no dissector of VoE."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.voe import VoeMessage, decode_voe
from tests.wire.strategies import u16, u32

# Vendor ID, 32 bits, and vendor type, 16 bits: IgH, voe_handler.c.
GOLDEN = {
    "020000000100": VoeMessage(2, 1),
    "efbeadde3412616263": VoeMessage(0xDEADBEEF, 0x1234, b"abc"),
}


@pytest.mark.parametrize("encoded", GOLDEN)
def test_golden_bytes(encoded: str) -> None:
    assert GOLDEN[encoded].encode().hex() == encoded
    assert decode_voe(bytes.fromhex(encoded)) == GOLDEN[encoded]


@given(st.builds(VoeMessage, u32, u16, st.binary(max_size=40)))
def test_every_message_survives_a_round_trip(message: VoeMessage) -> None:
    assert decode_voe(message.encode()) == message


def test_short_messages_are_refused() -> None:
    with pytest.raises(DecodeError, match="needs 6 bytes, received 5"):
        decode_voe(bytes(5))


@pytest.mark.parametrize("message", [VoeMessage(1 << 32, 0), VoeMessage(0, 1 << 16)])
def test_fields_that_do_not_fit_are_refused(message: VoeMessage) -> None:
    with pytest.raises(ValueError, match="VoE"):
        message.encode()
