"""Index and summary at the end of an MCAP file, made from its complete records."""

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
    CHUNK,
    DATA_END,
    END_RECORD,
    FOOTER,
    HEAD,
    LAYOUT_RECORD,
    MAGIC,
    MESSAGE_INDEX,
    METADATA,
    Place,
    add_descriptions,
    chunk_bytes,
    chunk_messages,
    places,
    read_record,
)


@dataclass(frozen=True, slots=True)
class CompleteChunk:
    """A complete chunk of the file."""

    index: Any  # ChunkIndex of the library
    counts: Counter[int]  # number of messages by channel id


@dataclass(slots=True)
class Summary:
    """Contents of the complete part of a data section."""

    end: int = len(MAGIC)  # position after the complete part
    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    chunks: list[CompleteChunk] = field(default_factory=list)
    metadata: list[Any] = field(default_factory=list)  # MetadataIndex of the library
    ended: dict[str, str] = field(default_factory=dict)  # end record of the recorder
    first_ns: int | None = None  # log time of the first cycle
    complete: bool = False  # True if the end of the data section was found
    missing: bytes = b""  # index of the last chunk, if it must be written again

    @property
    def seconds(self) -> float:
        """Time from the first cycle to the last message [s]."""
        if not self.chunks or self.first_ns is None:
            return 0.0
        return float((self.chunks[-1].index.message_end_time - self.first_ns) * 1e-9)

    def drop_last_chunk(self) -> None:
        """Remove the last chunk and everything after it from the summary, not from the file."""
        self.missing, self.complete = b"", False
        self.end = self.chunks.pop().index.chunk_start_offset
        self.metadata = [each for each in self.metadata if each.offset < self.end]


def read_complete_part(stream: BinaryIO) -> Summary:
    """Read a file up to its end, or up to the first damaged record.

    Raises:
        RecordingError: The file is not a recording of Catenary.
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
            hint="repair other MCAP files with `mcap recover` (https://mcap.dev)",
        )
    return summary


def groups(found: Iterable[Place]) -> Iterator[list[Place]]:
    """Yield every record together with the message indexes that follow it."""
    group: list[Place] = []
    for place in found:
        if group and place.opcode != MESSAGE_INDEX:
            yield group
            group = []
        group.append(place)
    if group:
        yield group


def _add_chunk(summary: Summary, stream: BinaryIO, place: Place, indexes: list[Place]) -> bool:
    """Add a chunk to the summary. Return False if the complete part of the file ends here.

    A damaged chunk is not added. If only its index is incomplete, the chunk is added, and
    `summary.missing` receives a new index.
    """
    records: Any = require("mcap.records")
    chunk = read_record(stream, place)
    data = chunk_bytes(chunk) if chunk is not None else None
    if data is None:
        return False
    counts = Counter(message.channel for message in chunk_messages(data))
    offsets = {_channel(stream, index): index.offset for index in indexes}
    length = indexes[-1].end - place.end if indexes else 0
    indexed = set(offsets) == set(counts)
    if not indexed:
        offsets, summary.missing = _make_index(data, place.end)
        length = len(summary.missing)
    add_descriptions(summary.schemas, summary.channels, data)
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
    summary.chunks.append(CompleteChunk(index, counts))
    summary.end = place.end + (length if indexed else 0)
    return indexed


def _make_index(data: bytes, start: int) -> tuple[dict[int, int], bytes]:
    """Make the message indexes of a chunk, for the position `start` of the file.

    Returns:
        Position of the index of each channel, and the encoded indexes.
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
    """Return the log time of the first message that is not an event; None if there is none."""
    cycles = {each.id for each in summary.channels.values() if not is_event(each.topic)}
    times = (each.time_ns for each in chunk_messages(data) if each.channel in cycles)
    return next(times, None)


def _channel(stream: BinaryIO, index: Place) -> int:
    """Return the channel id of a MessageIndex."""
    stream.seek(index.offset + HEAD.size)
    return int.from_bytes(stream.read(2), "little")


def encode_end(summary: Summary, entries: dict[str, str]) -> bytes:
    """Encode everything that follows the complete part of the file.

    This is a missing index, the end record, the end of the data section, the summary and the
    footer.

    Args:
        summary: contents of the complete part.
        entries: entries of the end record; ignored if the recorder has written both this record
            and the end of the data section.
    """
    records: Any = require("mcap.records")
    metadata, data = list(summary.metadata), summary.missing
    if not (summary.complete and summary.ended):
        last = _encode([records.Metadata(END_RECORD, {**summary.ended, **entries})])
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
