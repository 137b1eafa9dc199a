"""Frames of the EtherCAT mailbox gateway (ETG.8200) over UDP and TCP, port 0x88A4.

A frame is an EtherCAT header of type 5 and one mailbox message (ETG.1000.4 §5.1, §5.6):

    length (11 bits), reserved bit, type (4 bits) | mailbox header | data

The address in the mailbox header selects the device. In TCP, frames follow each other directly. The
bytes after a message are ignored, as in ethercrab (mailbox_gateway.rs). KickCAT (Gateway.cc) also
compares only the type and the length.
"""

from __future__ import annotations

from catenary.errors import DecodeError
from catenary.wire.frame import ETHERCAT_HEADER_SIZE, ETHERTYPE
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, decode_mailbox

PORT = ETHERTYPE  # of UDP and TCP: the number of the EtherType
MAXIMUM_LENGTH = 0x07FF  # [bytes] of a mailbox message with its header
MAXIMUM_SIZE = ETHERCAT_HEADER_SIZE + MAXIMUM_LENGTH
_TYPE = 5
_RESERVED = 0x0800


def encode_gateway(message: Mailbox) -> bytes:
    """Return the frame with a message. Raises ValueError if the message does not fit."""
    encoded = message.encode()
    if len(encoded) > MAXIMUM_LENGTH:
        raise ValueError(
            f"mailbox message of {len(encoded)} bytes exceeds the {MAXIMUM_LENGTH} bytes of a "
            "gateway frame"
        )
    return (len(encoded) | _TYPE << 12).to_bytes(ETHERCAT_HEADER_SIZE, "little") + encoded


def frame_size(data: bytes | bytearray) -> int | None:
    """Return the size of the first frame of a stream; None if its header is not complete.

    Args:
        data: Received bytes, which begin with a header.

    Raises:
        DecodeError: The header is not that of a gateway frame. The next frame cannot be found then.
    """
    if len(data) < ETHERCAT_HEADER_SIZE:
        return None
    header = int.from_bytes(data[:ETHERCAT_HEADER_SIZE], "little")
    length = header & MAXIMUM_LENGTH
    if header >> 12 != _TYPE or header & _RESERVED:
        raise DecodeError(
            f"gateway: EtherCAT header 0x{header:04X}, type {header >> 12} instead of {_TYPE}"
        )
    if length < HEADER_SIZE:
        raise DecodeError(f"gateway: length {length}, but a mailbox header has {HEADER_SIZE} bytes")
    return ETHERCAT_HEADER_SIZE + length


def decode_gateway(data: bytes) -> Mailbox:
    """Decode the message of a frame, such as a UDP datagram.

    Raises:
        DecodeError: The header is not that of a gateway frame, or the frame is truncated, or its
            mailbox header is invalid.
    """
    size = frame_size(data)
    if size is None or size > len(data):
        raise DecodeError(f"gateway: frame of {size or '2 or more'} bytes, received {len(data)}")
    return decode_mailbox(data[ETHERCAT_HEADER_SIZE:size])
