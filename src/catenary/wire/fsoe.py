"""Layout of the safety PDU of FSoE (Safety over EtherCAT), as Beckhoff publishes it.

The PDU has a command, one byte or n pairs of bytes of safety data, a CRC after each byte or pair,
and a connection ID (ST_FSoE_xxBytes of TwinCAT; the commands are those of ETG.5100). Catenary
relays these frames. It does not check or make a CRC. `safety_crc` serves the virtual devices: its
polynomial is that of FSoE, but its input is simplified, so it does not conform to ETG.5100.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from catenary.errors import DecodeError

SINGLE = 6  # size of a PDU with one byte of safety data [bytes]
OVERHEAD = 3  # command and connection ID [bytes]
PAIR = 4  # two bytes of safety data, and their CRC [bytes]
SIZE_MAX = OVERHEAD + 63 * PAIR  # more than any PDO of a safety device
POLYNOMIAL = 0x39B7  # x^16 is implicit


class FsoeCommand(IntEnum):
    """Commands of a safety PDU."""

    FAIL_SAFE_DATA = 0x08
    RESET = 0x2A
    PROCESS_DATA = 0x36
    SESSION = 0x4E
    PARAMETER = 0x52
    CONNECTION = 0x64


class SafetyPdu(NamedTuple):
    """Parts of a safety PDU. `data` has one CRC for each pair of bytes, or for its only byte."""

    command: int
    data: bytes
    crcs: tuple[int, ...]
    connection_id: int


def is_frame_size(size: int) -> bool:
    """Return True if a safety PDU can have this size [bytes]."""
    return size == SINGLE or (OVERHEAD + PAIR <= size <= SIZE_MAX and (size - OVERHEAD) % PAIR == 0)


def command_of(frame: bytes) -> int:
    """Return the command of a safety PDU."""
    return frame[0]


def connection_id_of(frame: bytes) -> int:
    """Return the connection ID of a safety PDU; 0 if none is set."""
    return int.from_bytes(frame[-2:], "little")


def command_text(command: int) -> str:
    """Return the name of a command, or its number."""
    try:
        return FsoeCommand(command).name
    except ValueError:
        return f"0x{command:02X}"


def encode(pdu: SafetyPdu) -> bytes:
    """Return a safety PDU as bytes.

    Raises:
        ValueError: The number of CRCs does not agree with the data.
    """
    parts = blocks(pdu.data)
    if len(parts) != len(pdu.crcs):
        raise ValueError(f"{len(pdu.data)} bytes need {len(parts)} CRCs, not {len(pdu.crcs)}")
    body = b"".join(
        part + struct.pack("<H", crc) for part, crc in zip(parts, pdu.crcs, strict=True)
    )
    return bytes([pdu.command]) + body + struct.pack("<H", pdu.connection_id)


def decode(frame: bytes) -> SafetyPdu:
    """Return the parts of a safety PDU. Its CRCs are not checked.

    Raises:
        DecodeError: A safety PDU cannot have this size.
    """
    if not is_frame_size(len(frame)):
        raise DecodeError(f"an FSoE frame has 6 or 3 + 4·n bytes, not {len(frame)}")
    width = 1 if len(frame) == SINGLE else 2
    body = frame[1:-2]
    parts = [body[k : k + width + 2] for k in range(0, len(body), width + 2)]
    return SafetyPdu(
        frame[0],
        b"".join(part[:width] for part in parts),
        tuple(int.from_bytes(part[width:], "little") for part in parts),
        connection_id_of(frame),
    )


def blocks(data: bytes) -> list[bytes]:
    """Return the parts of safety data that have a CRC each.

    Raises:
        ValueError: The length is neither 1 nor a positive even number.
    """
    if len(data) == 1:
        return [data]
    if not data or len(data) % 2:
        raise ValueError(f"safety data has 1 byte or an even number of bytes, not {len(data)}")
    return [data[k : k + 2] for k in range(0, len(data), 2)]


def safety_crc(numbers: Sequence[int], data: bytes) -> int:
    """Return a CRC of 16 bits over some 16-bit numbers and a part of the safety data.

    Args:
        numbers: What both ends know, such as the sequence number and the CRC received last.
        data: Part of the safety data.
    """
    crc = 0
    for byte in (*struct.pack(f"<{len(numbers)}H", *numbers), *data):
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (POLYNOMIAL if crc & 0x8000 else 0)) & 0xFFFF
    return crc
