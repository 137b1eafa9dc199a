"""What stands at the end of an MCAP file: index and summary, made from what is whole in it."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from catenary.errors import RecordingError
from catenary.record.channels import is_event
from catenary.record.extra import require
from catenary.record.mcap_records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    END_RECORD,
    FOOTER,
    HEAD,
    LAYOUT_RECORD,
    MAGIC,
    MESSAGE_INDEX,
    METADATA,
    SCHEMA,
    Place,
    chunk_bytes,
    chunk_messages,
    chunk_records,
    decode_record,
    places,
    read_record,
)


@dataclass(frozen=True, slots=True)
class WholeChunk:
    """A chunk, with its index behind it."""

    index: Any  # the library's ChunkIndex
    counts: Counter[int]  # messages of each channel


@dataclass(slots=True)
class Summary:
    """Owns what is known of a file's data section. `end`: where what is whole of it ends."""

    end: int = len(MAGIC)
    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    chunks: list[WholeChunk] = field(default_factory=list)
    metadata: list[Any] = field(default_factory=list)  # the library's MetadataIndex
    ended: dict[str, str] = field(default_factory=dict)  # what the recorder said of its end
    first_ns: int | None = None  # log time of the first cycle
    complete: bool = False  # the end of the data section is there
    missing: bytes = b""  # index of the last chunk, to be written behind it

    @property
    def seconds(self) -> float:
        """From the first cycle to the last message."""
        if not self.chunks or self.first_ns is None:
            return 0.0
        return float((self.chunks[-1].index.message_end_time - self.first_ns) * 1e-9)

    def drop_last_chunk(self) -> None:
        self.missing, self.complete = b"", False
        self.end = self.chunks.pop().index.chunk_start_offset
        self.metadata = [each for each in self.metadata if each.offset < self.end]


def find_whole(stream: BinaryIO) -> Summary:
    """Read a file up to its end, or to the first damage.

    Raises:
        RecordingError: It is not a recording of Catenary.
    """
    records: Any = require("mcap.records")
    summary = Summary()
    for group in groups(places(stream)):
        first, indexes = group[0], group[1:]
        if first.opcode == CHUNK:
            if not _add_chunk(summary, stream, first, indexes):
                break
            continue
        if first.opcode == METADATA:
            record = read_record(stream, first)
            if record is None:
                break
            if record.name == END_RECORD:
                summary.ended = record.metadata
            length = first.end - first.offset
            summary.metadata.append(records.MetadataIndex(first.offset, length, record.name))
        if first.opcode == DATA_END:
            summary.complete = True
            break
        summary.end = first.end
    if LAYOUT_RECORD not in [each.name for each in summary.metadata]:
        raise RecordingError(
            f"{stream.name} is not a recording of Catenary",
            hint="repair other MCAP files with `mcap recover`, by MCAP's authors",
        )
    return summary


def groups(found: Iterable[Place]) -> Iterator[list[Place]]:
    """Every record with the message indexes that follow it."""
    group: list[Place] = []
    for place in found:
        if group and place.opcode != MESSAGE_INDEX:
            yield group
            group = []
        group.append(place)
    if group:
        yield group


def _add_chunk(summary: Summary, stream: BinaryIO, place: Place, indexes: list[Place]) -> bool:
    """Add a chunk. Return False if the chunk or its index is not whole: nothing can follow."""
    records: Any = require("mcap.records")
    chunk = read_record(stream, place)
    data = chunk_bytes(chunk) if chunk is not None else None
    if data is None:
        return False
    counts = Counter(message.channel for message in chunk_messages(data))
    offsets = {_channel(stream, index): index.offset for index in indexes}
    length = indexes[-1].end - place.end if indexes else 0
    whole = set(offsets) == set(counts)
    if not whole:
        offsets, summary.missing = _index_anew(data, place.end)
        length = len(summary.missing)
    _add_descriptions(summary, data)
    if summary.first_ns is None:
        summary.first_ns = _first_cycle(summary, data)
    index = records.ChunkIndex(
        chunk_start_offset=place.offset,
        chunk_length=place.end - place.offset,
        message_start_time=chunk.message_start_time,
        message_end_time=chunk.message_end_time,
        message_index_offsets=offsets,
        message_index_length=length,
        compression=chunk.compression,
        compressed_size=len(chunk.data),
        uncompressed_size=chunk.uncompressed_size,
    )
    summary.chunks.append(WholeChunk(index, counts))
    summary.end = place.end + (length if whole else 0)
    return whole


def _index_anew(data: bytes, start: int) -> tuple[dict[int, int], bytes]:
    """Return the index of a chunk for the position `start`.

    Returns:
        The position of the index of each channel, and the bytes of all.
    """
    records: Any = require("mcap.records")
    entries: dict[int, list[tuple[int, int]]] = {}
    for message in chunk_messages(data):
        entries.setdefault(message.channel, []).append((message.time_ns, message.offset))
    offsets, coded = {}, b""
    for channel, times in entries.items():
        offsets[channel] = start + len(coded)
        coded += _encode([records.MessageIndex(channel, times)])
    return offsets, coded


def _first_cycle(summary: Summary, data: bytes) -> int | None:
    """Return the log time of the first message that is not an event."""
    cycles = {each.id for each in summary.channels.values() if not is_event(each.topic)}
    times = (each.time_ns for each in chunk_messages(data) if each.channel in cycles)
    return next(times, None)


def _channel(stream: BinaryIO, index: Place) -> int:
    """Which channel a MessageIndex is of."""
    stream.seek(index.offset + HEAD.size)
    return int.from_bytes(stream.read(2), "little")


def _add_descriptions(summary: Summary, data: bytes) -> None:
    for opcode, at, end in chunk_records(data):
        if opcode == SCHEMA:
            schema = decode_record(data[at:end])
            summary.schemas[schema.id] = schema
        elif opcode == CHANNEL:
            channel = decode_record(data[at:end])
            summary.channels[channel.id] = channel


def encode_end(summary: Summary, words: dict[str, str]) -> bytes:
    """All that follows `summary.end`: a missing index, a metadata record, the end of the data, the
    summary, the footer."""
    records: Any = require("mcap.records")
    metadata, data = list(summary.metadata), summary.missing
    if not (summary.complete and summary.ended):  # else the recorder has said it
        last = _encode([records.Metadata(END_RECORD, {**summary.ended, **words})])
        metadata = [each for each in metadata if each.name != END_RECORD]
        metadata.append(records.MetadataIndex(summary.end + len(data), len(last), END_RECORD))
        data += last
    data += _encode([records.DataEnd(0)])
    return data + _encode_summary(summary, metadata, summary.end + len(data))


def _encode_summary(summary: Summary, metadata: list[Any], start: int) -> bytes:
    records: Any = require("mcap.records")
    opcodes: Any = require("mcap.opcode").Opcode
    sections = (
        (opcodes.SCHEMA, list(summary.schemas.values())),
        (opcodes.CHANNEL, list(summary.channels.values())),
        (opcodes.STATISTICS, [_statistics(summary, len(metadata))]),
        (opcodes.CHUNK_INDEX, [chunk.index for chunk in summary.chunks]),
        (opcodes.METADATA_INDEX, metadata),
    )
    coded, offsets = b"", []
    for opcode, members in sections:
        section = _encode(members)
        if section:
            offsets.append(records.SummaryOffset(opcode, start + len(coded), len(section)))
        coded += section
    offset_start = start + len(coded)
    coded += _encode(offsets)
    footer = HEAD.pack(FOOTER, 20) + struct.pack("<QQ", start, offset_start)
    checksum = zlib.crc32(coded + footer)
    return coded + footer + struct.pack("<I", checksum) + MAGIC


def _statistics(summary: Summary, metadata: int) -> Any:
    records: Any = require("mcap.records")
    counts: Counter[int] = sum((chunk.counts for chunk in summary.chunks), Counter())
    return records.Statistics(
        message_count=counts.total(),
        schema_count=len(summary.schemas),
        channel_count=len(summary.channels),
        attachment_count=0,
        metadata_count=metadata,
        chunk_count=len(summary.chunks),
        message_start_time=min((c.index.message_start_time for c in summary.chunks), default=0),
        message_end_time=max((c.index.message_end_time for c in summary.chunks), default=0),
        channel_message_counts=dict(counts),
    )


def _encode(members: Iterable[Any]) -> bytes:
    builder: Any = require("mcap.data_stream").RecordBuilder()
    for member in members:
        member.write(builder)
    return bytes(builder.end())
