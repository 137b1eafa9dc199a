"""Layout of safety PDUs. The bytes follow ST_FSoE_xxBytes of Beckhoff's TwinSAFE documentation."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.fsoe import (
    SafetyPdu,
    blocks,
    command_text,
    connection_id_of,
    decode,
    encode,
    is_frame_size,
    safety_crc,
)


def test_the_parts_of_a_frame_with_four_bytes() -> None:
    frame = bytes.fromhex("36 0102 aabb 0304 ccdd 0500")
    assert decode(frame) == SafetyPdu(0x36, b"\1\2\3\4", (0xBBAA, 0xDDCC), 5)
    assert connection_id_of(frame) == 5


def test_the_parts_of_a_frame_with_one_byte() -> None:
    """The EL1904 has this frame: 8 bits CMD, 8 bits data, CRC_0, connection ID."""
    assert decode(bytes.fromhex("4e 07 3412 0100")) == SafetyPdu(0x4E, b"\7", (0x1234,), 1)


def test_sizes() -> None:
    assert [size for size in range(20) if is_frame_size(size)] == [6, 7, 11, 15, 19]
    assert not is_frame_size(259)


@given(st.binary(max_size=300))
def test_any_bytes_are_decoded_or_refused(frame: bytes) -> None:
    if not is_frame_size(len(frame)):
        with pytest.raises(DecodeError, match="3 \\+ 4·n bytes"):
            decode(frame)
        return
    assert encode(decode(frame)) == frame


@pytest.mark.parametrize("data", [b"", b"\1\2\3"])
def test_impossible_safety_data(data: bytes) -> None:
    with pytest.raises(ValueError, match="safety data has 1 byte or an even number"):
        blocks(data)


def test_the_number_of_crcs_must_agree() -> None:
    with pytest.raises(ValueError, match="4 bytes need 2 CRCs, not 1"):
        encode(SafetyPdu(0x36, bytes(4), (0,), 1))


def test_the_polynomial_of_the_crc() -> None:
    """A message of a single one bit in front of 16 zeros has the polynomial as its CRC."""
    assert safety_crc((), b"\x01") == 0x39B7
    assert safety_crc((), b"\x02") == 0x39B7 << 1
    assert safety_crc((1,), b"") == safety_crc((), b"\x01\x00")


@given(st.binary(min_size=1, max_size=8), st.integers(0, 63))
def test_every_inverted_bit_changes_the_crc(data: bytes, bit: int) -> None:
    bit %= 8 * len(data)
    wrong = (int.from_bytes(data, "little") ^ 1 << bit).to_bytes(len(data), "little")
    assert safety_crc((1, 2), wrong) != safety_crc((1, 2), data)


def test_names_of_commands() -> None:
    assert (command_text(0x2A), command_text(0)) == ("RESET", "0x00")
