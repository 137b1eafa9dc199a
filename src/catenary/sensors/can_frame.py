"""CAN frames as bytes: the header of Linux' `struct can_frame`, then only the data of the frame.

0   u32      identifier, with flags in the upper three bits
4   u8       bytes of data
5   3 bytes  zero
8   data     up to 8 bytes, with CAN FD up to 64

Source: include/uapi/linux/can.h and can/error.h.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from catenary.errors import DecodeError

HEADER = struct.Struct("<IB3x")
EXTENDED = 0x8000_0000  # CAN_EFF_FLAG: 29-bit identifier
REMOTE = 0x4000_0000  # CAN_RTR_FLAG
ERROR = 0x2000_0000  # CAN_ERR_FLAG: the identifier has the class of an error
BUS_OFF = 0x0000_0040  # CAN_ERR_BUSOFF
EXTENDED_MAX = 0x1FFF_FFFF
STANDARD_MAX = 0x7FF
DATA_MAX = 64  # [bytes] of a CAN FD frame


class CanFrame(NamedTuple):
    """One frame, or an error of the controller."""

    identifier: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    error: bool = False


def encode_frame(frame: CanFrame) -> bytes:
    """Return the bytes of a frame.

    Raises ValueError if the identifier or the data are too long.
    """
    most = EXTENDED_MAX if frame.extended or frame.error else STANDARD_MAX
    if not 0 <= frame.identifier <= most or len(frame.data) > DATA_MAX:
        raise ValueError(f"{frame}: the identifier is over 0x{most:X}, or the data over 64 bytes")
    flags = EXTENDED * frame.extended | REMOTE * frame.remote | ERROR * frame.error
    return HEADER.pack(flags | frame.identifier, len(frame.data)) + frame.data


def decode_frame(data: bytes) -> CanFrame:
    """Return the frame in `data`. Raises DecodeError if its length does not fit."""
    if len(data) < HEADER.size or len(data) != HEADER.size + data[4]:
        raise DecodeError(f"a CAN frame has {len(data)} bytes, which does not match its header")
    word, _ = HEADER.unpack_from(data)
    return CanFrame(
        word & EXTENDED_MAX,
        data[HEADER.size :],
        bool(word & EXTENDED),
        bool(word & REMOTE),
        bool(word & ERROR),
    )
