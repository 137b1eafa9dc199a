"""Commands of MicroStrain's MIP protocol that start and stop a data stream, and their replies.

Devices of generation 7 (CV7, GV7, GQ7) have one command for all data sets. Those of generation 5
and before (GX4, GX5, CV5, RQ1) have one command for each data set, and selectors for their streams.

Sources: github.com/LORD-MicroStrain/mip_sdk, src/c/mip/definitions/commands_base.h and
commands_3dm.h, src/c/mip/mip_result.h; data communications protocol manual 8500-0064, section 4.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from catenary.sensors.mip_fields import FILTER_DATA, SENSOR_DATA
from catenary.sensors.mip_packet import Field, Packet, encode_packet

BASE = 0x01  # descriptor sets of commands
THREE_DM = 0x0C

PING = 0x01
SET_TO_IDLE = 0x02
RESUME = 0x06
DATA_STREAM = 0x11
WRITE = 0x01  # function selector
ACKNOWLEDGE = 0xF1  # field of a reply: u8 command, u8 result

RESULTS = {
    0x00: "success",
    0x01: "the command is not supported",
    0x02: "the checksum is wrong",
    0x03: "a parameter is invalid",
    0x04: "the command failed",
    0x05: "the device timed out",
}
COMMANDS = {
    (BASE, PING): "ping",
    (BASE, SET_TO_IDLE): "set to idle",
    (BASE, RESUME): "resume",
    (THREE_DM, 0x06): "get base rate",
    (THREE_DM, 0x08): "message format",
    (THREE_DM, 0x0A): "message format",
    (THREE_DM, 0x0B): "get base rate",
    (THREE_DM, 0x0E): "get base rate",
    (THREE_DM, 0x0F): "message format",
    (THREE_DM, DATA_STREAM): "data stream control",
}


class Dialect(NamedTuple):
    """Commands of one generation of devices for one data set."""

    base_rate: int  # command, and the field of its reply
    base_rate_reply: int
    message_format: int
    selector: bytes  # bytes that name the data set in the first two commands
    stream: int  # selector of the stream


DIALECTS: dict[tuple[int, int], Dialect] = {  # by generation and data set
    (5, SENSOR_DATA): Dialect(0x06, 0x83, 0x08, b"", 0x01),
    (5, FILTER_DATA): Dialect(0x0B, 0x8A, 0x0A, b"", 0x03),
    (7, SENSOR_DATA): Dialect(0x0E, 0x8E, 0x0F, b"\x80", 0x80),
    (7, FILTER_DATA): Dialect(0x0E, 0x8E, 0x0F, b"\x82", 0x82),
}


class Reply(NamedTuple):
    """Result of a command."""

    descriptor_set: int
    command: int
    result: int  # 0: success

    @property
    def text(self) -> str:
        """Name of the command and its result, for messages."""
        key = (self.descriptor_set, self.command)
        name = COMMANDS.get(key, "command")
        result = RESULTS.get(self.result, f"code 0x{self.result:02X}")
        return f"{name} (0x{key[0]:02X}, 0x{key[1]:02X}): {result}"


def ping() -> bytes:
    """Return the command without effect, which the device acknowledges."""
    return encode_packet(BASE, [Field(PING, b"")])


def set_to_idle() -> bytes:
    """Return the command that ends all data streams."""
    return encode_packet(BASE, [Field(SET_TO_IDLE, b"")])


def resume() -> bytes:
    """Return the command that restores the data streams before `set_to_idle`."""
    return encode_packet(BASE, [Field(RESUME, b"")])


def read_base_rate(dialect: Dialect) -> bytes:
    """Return the request for the base rate of a data set, to which decimations refer."""
    return encode_packet(THREE_DM, [Field(dialect.base_rate, dialect.selector)])


def write_message_format(dialect: Dialect, descriptors: Sequence[int], decimation: int) -> bytes:
    """Return the command that selects the fields of a data set.

    Args:
        dialect: commands of the device for the data set.
        descriptors: descriptors of the fields, in the order of the packet.
        decimation: base rate divided by the rate of the fields.
    """
    data = bytes((WRITE,)) + dialect.selector + bytes((len(descriptors),))
    data += b"".join(struct.pack(">BH", each, decimation) for each in descriptors)
    return encode_packet(THREE_DM, [Field(dialect.message_format, data)])


def control_data_stream(dialect: Dialect, enable: bool) -> bytes:
    """Return the command that starts or stops the stream of a data set.

    Args:
        dialect: commands of the device for the data set.
        enable: True to start the stream.
    """
    return encode_packet(THREE_DM, [Field(DATA_STREAM, bytes((WRITE, dialect.stream, enable)))])


def replies(packet: Packet) -> Iterator[Reply]:
    """Yield the results in a packet of a command set."""
    for descriptor, data in packet.fields:
        if descriptor == ACKNOWLEDGE and len(data) == 2:
            yield Reply(packet.descriptor_set, data[0], data[1])


def base_rate_of(packet: Packet, dialect: Dialect) -> int | None:
    """Return the base rate in a reply [Hz]; None if the packet has none for this data set.

    Args:
        packet: packet of a command set.
        dialect: commands of the device for the data set.
    """
    for descriptor, data in packet.fields:
        if descriptor == dialect.base_rate_reply and data[:-2] == dialect.selector:
            return int.from_bytes(data[-2:], "big")
    return None
