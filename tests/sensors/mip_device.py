"""Simulated MicroStrain device: an encoder of the protocol that shares no code with the package.

Layout: github.com/LORD-MicroStrain/mip_sdk, src/c/mip/definitions; manual 8500-0064.
"""

from __future__ import annotations

import struct


def packet(descriptor_set: int, *fields: tuple[int, bytes]) -> bytes:
    body = b"".join(struct.pack("BB", len(data) + 2, number) + data for number, data in fields)
    message = b"ue" + struct.pack("BB", descriptor_set, len(body)) + body
    low = sum(message) % 256
    high = sum((len(message) - k) * byte for k, byte in enumerate(message)) % 256
    return message + struct.pack("BB", low, high)


def reference(time_ns: int) -> tuple[int, bytes]:
    return 0xD5, struct.pack(">Q", time_ns)


def gps(seconds: float, week: int = 2300, flags: int = 0) -> tuple[int, bytes]:
    return 0x12, struct.pack(">dHH", seconds, week, flags)


def vector(descriptor: int, *values: float) -> tuple[int, bytes]:
    return descriptor, struct.pack(f">{len(values)}f", *values)


def imu(time_ns: int, acceleration_g: float = 1.0, rate: float = 0.5) -> bytes:
    """Return a packet of scaled accelerations and rates, with the reference time."""
    return packet(
        0x80,
        reference(time_ns),
        vector(0x04, 0.0, 0.0, acceleration_g),
        vector(0x05, rate, 0.0, 0.0),
    )


def reply(descriptor_set: int, command: int, code: int, *fields: tuple[int, bytes]) -> bytes:
    return packet(descriptor_set, (0xF1, bytes((command, code))), *fields)
