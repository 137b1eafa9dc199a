"""Reader of the complete records of an MCAP file, which may be truncated.

The library's readers raise an error at a truncated end. This module reads up to the last complete
record. MCAP: https://mcap.dev/spec
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import msgspec

from catenary.errors import RecordingError
from catenary.record.extra import require

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode, length of the content
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = range(0x01, 0x08)
METADATA, DATA_END = 0x0C, 0x0F
LAYOUT_RECORD = "catenary.layout"  # metadata at the start of a recording
END_RECORD = "catenary.end"  # metadata at its end
LARGEST_CHUNK = 1 << 28  # [bytes]; a larger size indicates damage


@contextmanager
def refusing_damage(name: str) -> Iterator[None]:
    """Convert the exceptions that a damaged file causes into RecordingError."""
    damage: tuple[type[Exception], ...] = (
        *(require("mcap.exceptions").McapError, msgspec.MsgspecError, struct.error),
        *(ArithmeticError, LookupError, MemoryError, RecursionError, TypeError, ValueError),
    )
    try:
        yield
    except damage as error:
        what = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{name} is damaged ({what})") from error


class Place(NamedTuple):
    """A complete record in a file."""

    opcode: int
    offset: int  # position of its first byte, the opcode
    end: int  # position after its last byte


class ChunkMessage(NamedTuple):
    """A message within a chunk."""

    channel: int
    sequence: int
    time_ns: int  # log time, UTC
    offset: int  # position of its record within the chunk
    data: bytes


def places(stream: BinaryIO) -> Iterator[Place]:
    """Yield the complete records of the data section.

    Raises:
        RecordingError: The file is not an MCAP file.
    """
    size = os.fstat(stream.fileno()).st_size
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        raise RecordingError(f"{stream.name} is not an MCAP file: wrong first bytes")
    at = len(MAGIC)
    while at + HEAD.size <= size:
        stream.seek(at)
        opcode, length = HEAD.unpack(stream.read(HEAD.size))
        end = at + HEAD.size + length
        if end > size or not HEADER <= opcode <= DATA_END:
            return
        yield Place(opcode, at, end)
        if opcode == DATA_END:
            return
        at = end


def read_record(stream: BinaryIO, place: Place) -> Any:
    """Return a record as an object of the library; None if it is damaged.

    Args:
        stream: the file.
        place: position of the Metadata or Chunk record.
    """
    exceptions: Any = require("mcap.exceptions")
    stream.seek(place.offset)
    try:
        return decode_record(stream.read(place.end - place.offset))
    except (exceptions.McapError, struct.error, ValueError, OverflowError, MemoryError):
        return None


def decode_record(data: bytes) -> Any:
    """Decode a Metadata, Chunk, Schema or Channel record into an object of the library."""
    records: Any = require("mcap.records")
    streams: Any = require("mcap.data_stream")
    kinds = {
        METADATA: records.Metadata,
        CHUNK: records.Chunk,
        SCHEMA: records.Schema,
        CHANNEL: records.Channel,
    }
    return kinds[data[0]].read(streams.ReadDataStream(BytesIO(data[HEAD.size :])))


def chunk_bytes(chunk: Any) -> bytes | None:
    """Return the uncompressed content of a chunk; None if it is damaged."""
    reader: Any = require("mcap.stream_reader")
    unknown: Any = require("mcap.exceptions").McapError
    damage = (ValueError, RuntimeError, MemoryError, unknown, require("zstandard").ZstdError)
    if chunk.uncompressed_size > LARGEST_CHUNK:
        return None
    try:
        stream, length = reader.get_chunk_data_stream(chunk, validate_crc=True)
        return bytes(stream.read(length))
    except damage:
        return None


def chunk_records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, offset, end) of each record in the content of a chunk."""
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        yield opcode, at, at + HEAD.size + length
        at += HEAD.size + length


def add_descriptions(schemas: dict[int, Any], channels: dict[int, Any], data: bytes) -> None:
    """Add the schemas and channels of a chunk, by their ids.

    Args:
        schemas: receives the schemas.
        channels: receives the channels.
        data: records of the chunk.
    """
    for opcode, at, end in chunk_records(data):
        if opcode == SCHEMA:
            schema = decode_record(data[at:end])
            schemas[schema.id] = schema
        elif opcode == CHANNEL:
            channel = decode_record(data[at:end])
            channels[channel.id] = channel


def chunk_messages(data: bytes) -> Iterator[ChunkMessage]:
    """Yield the messages in the content of a chunk, in file order."""
    for opcode, at, end in chunk_records(data):
        if opcode == MESSAGE:
            _, _, channel, sequence, time_ns, _ = MESSAGE_HEAD.unpack_from(data, at)
            yield ChunkMessage(channel, sequence, time_ns, at, data[at + MESSAGE_HEAD.size : end])
