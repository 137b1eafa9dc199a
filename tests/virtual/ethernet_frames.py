"""Ethernet frames of a computer, for tests of a virtual device's network stack."""

from __future__ import annotations

import struct

OWN_MAC, OWN_IP = bytes.fromhex("020000000701"), bytes([192, 168, 7, 1])
MAC, IP = bytes.fromhex("020000000702"), bytes([192, 168, 7, 2])  # of the device
BROADCAST = b"\xff" * 6
ARP_REQUEST = (
    BROADCAST + OWN_MAC + bytes.fromhex("0806000108000604 0001") + OWN_MAC + OWN_IP + bytes(6) + IP
)
ARP_ANSWER = OWN_MAC + MAC + bytes.fromhex("0806000108000604 0002") + MAC + IP + OWN_MAC + OWN_IP


def sum_of(data: bytes) -> int:
    """Return the Internet checksum."""
    words = struct.unpack(f"!{len(data) // 2}H", data[: len(data) & ~1])
    total = sum(words) + (data[-1] << 8 if len(data) % 2 else 0)
    return ~((total & 0xFFFF) + (total >> 16)) & 0xFFFF


def with_sum(data: bytes, place: int) -> bytes:
    """Return data with the checksum at a place that is 0."""
    return data[:place] + struct.pack("!H", sum_of(data)) + data[place + 2 :]


def ip_frame(protocol: int, data: bytes) -> bytes:
    header = struct.pack(
        "!BBHHHBBH4s4s", 0x45, 0, 20 + len(data), 7, 0x4000, 64, protocol, 0, OWN_IP, IP
    )
    return MAC + OWN_MAC + b"\x08\x00" + with_sum(header, 10) + data


def ping(number: int, size: int = 56) -> bytes:
    """Return an echo request of `size` bytes of data."""
    data = bytes(k * 3 + number & 0xFF for k in range(size))
    return ip_frame(1, with_sum(struct.pack("!BBHHH", 8, 0, 0, 99, number) + data, 2))


def echo(frame: bytes) -> tuple[int, bytes] | None:
    """Return number and data of an echo answer; None for another frame."""
    if len(frame) < 42 or frame[12:14] != b"\x08\x00" or frame[23] != 1 or frame[34] != 0:
        return None
    assert sum_of(frame[14:34]) == 0
    assert sum_of(frame[34:]) == 0
    return int.from_bytes(frame[40:42], "big"), frame[42:]
