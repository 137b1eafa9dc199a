"""Network stack in place of a TAP interface: it pings a device through an `EthernetBridge`."""

from __future__ import annotations

import struct
import threading
from collections import deque

OWN_MAC, MAC = bytes.fromhex("020000000701"), bytes.fromhex("020000000702")
OWN_IP, IP = bytes((192, 168, 7, 1)), bytes((192, 168, 7, 2))
DATA = 1000  # [bytes] of a ping: several fragments
AGAIN = 0.05  # [s] between two pings
IPV4, ICMP, ECHO, ECHO_ANSWER = b"\x08\x00", 1, 8, 0
HEADER = 34  # [bytes] before the ICMP message


def checksum(data: bytes) -> int:
    """Return the Internet checksum, RFC 1071."""
    total: int = sum(struct.unpack(f"!{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def ping(number: int) -> bytes:
    """Return the Ethernet frame of an echo request."""
    body = bytes((k + number) & 0xFF for k in range(DATA))
    message = struct.pack("!BBHHH", ECHO, 0, 0, 7, number & 0xFFFF) + body
    message = message[:2] + struct.pack("!H", checksum(message)) + message[4:]
    size = 20 + len(message)
    header = struct.pack("!BBHHHBBH4s4s", 0x45, 0, size, 0, 0x4000, 64, ICMP, 0, OWN_IP, IP)
    header = header[:10] + struct.pack("!H", checksum(header)) + header[12:]
    return MAC + OWN_MAC + IPV4 + header + message


def answered(frame: bytes) -> int | None:
    """Return the number of an echo answer with correct data; None for another frame."""
    if len(frame) < HEADER + 8 or frame[12:14] != IPV4 or frame[23] != ICMP:
        return None
    if frame[HEADER] != ECHO_ANSWER:
        return None
    number = int.from_bytes(frame[HEADER + 6 : HEADER + 8], "big")
    return number if frame[HEADER + 8 :][:DATA] == ping(number)[HEADER + 8 :] else None


class PingInterface:
    """Interface of an `EthernetBridge`. It owns the pings that wait, and counts answers."""

    name = "ping"

    def __init__(self) -> None:
        self.sent = self.answers = self.wrong = 0
        self._waiting: deque[bytes] = deque()
        self._changed = threading.Event()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the time of the next ping. Return True if there is one."""
        self._changed.wait(AGAIN if seconds is None else min(seconds, AGAIN))
        if not self._waiting:
            self._waiting.append(ping(self.sent))
            self.sent += 1
        return True

    def wake(self) -> None:
        self._changed.set()

    def read(self) -> bytes | None:
        return self._waiting.popleft() if self._waiting else None

    def write(self, frame: bytes) -> bool:
        """Count an answer. Other frames of the device, such as ARP, are not answers."""
        if len(frame) > HEADER and frame[12:14] == IPV4:
            right = answered(frame) is not None
            self.answers += right
            self.wrong += not right
        return True

    def close(self) -> None:
        self._changed.set()
