"""Index of a recording: the places and times of its chunks. A part is read without the rest."""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import BinaryIO, NamedTuple

from catenary.errors import RecordingError
from catenary.record.channels import topic
from catenary.record.layout import Layout
from catenary.record.mcap_records import (
    CHUNK,
    DATA_END,
    HEAD,
    LARGEST_CHUNK,
    MESSAGE_INDEX,
    METADATA,
    Place,
    places,
    refusing_damage,
)
from catenary.record.recording import PartReader, Recording
from catenary.share import SharedEvent

CHUNK_HEAD = struct.Struct("<BQQQQ")  # opcode, length, first and last log time, size
RECORDS_MAX = 4_000_000  # of a file
METADATA_MAX = 64
CHANNEL_BYTES = 2  # of a MessageIndex record
EVENT_CHUNKS_MAX = 200
HEAD_MAX = 64  # chunks up to the first one with a cycle
SECOND_NS = 1_000_000_000


class ChunkPlace(NamedTuple):
    """A chunk, its log times, and the numbers of its channels."""

    place: Place
    first_ns: int
    last_ns: int
    channels: tuple[int, ...]


class RecordingIndex:
    """Places of the chunks of a recording. Opening reads only heads of records.

        index = RecordingIndex("arm.mcap")
        part = index.read(12.0, 13.5)

    A truncated or damaged file is used up to the first damaged record.

    Args:
        path: the file.

    Raises:
        RecordingError: The file is not a recording of Catenary, has no cycle, is damaged, or has
            too many records; or the extra is not installed.
        OSError: The file cannot be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.chunks: list[ChunkPlace] = []
        self._fixed: list[Place] = []  # metadata, and the end of the data section
        with self.path.open("rb") as stream, refusing_damage(stream.name):
            self._scan(stream)
            self._head = self._find_head(stream)
            first = self._read(stream, 0.0, 0.0, self.chunks[: self._head])
            self._event_channel = self._find_event_channel(stream, first.layout)
        self.layout: Layout = first.layout
        self.ended, self.lost = first.ended, first.lost
        self.start_ns = first.start_ns  # of the first cycle, on the clock of the loop

    @property
    def duration(self) -> float:
        """Time from the first cycle to the last message [s]."""
        last = max(chunk.last_ns for chunk in self.chunks)
        return max(last - self._start_utc_ns, 0) / SECOND_NS

    def span(self, chunk: ChunkPlace) -> tuple[float, float]:
        """Return the start and the end of a chunk [s] after the first cycle."""
        start = self._start_utc_ns
        return (chunk.first_ns - start) / SECOND_NS, (chunk.last_ns - start) / SECOND_NS

    def overlapping(self, start: float, end: float) -> list[ChunkPlace]:
        """Return the chunks with messages in a part.

        Args:
            start: start of the part [s] after the first cycle.
            end: end of the part [s].
        """
        spans = ((chunk, *self.span(chunk)) for chunk in self.chunks)
        return [chunk for chunk, first, last in spans if first <= end and last >= start]

    def read(self, start: float, end: float) -> Recording:
        """Read a part.

        Args:
            start: start of the part [s] after the first cycle.
            end: end of the part [s].

        Raises:
            RecordingError: The part is damaged.
            OSError: The file cannot be read.
        """
        chunks = [*self.chunks[: self._head], *self.overlapping(start, end)]
        with self.path.open("rb") as stream, refusing_damage(stream.name):
            return self._read(stream, start, end, chunks)

    def events(self) -> tuple[SharedEvent, ...]:
        """Return the events of the first EVENT_CHUNKS_MAX chunks with events.

        Raises:
            RecordingError: A chunk is damaged.
            OSError: The file cannot be read.
        """
        chunks = [chunk for chunk in self.chunks if self._event_channel in chunk.channels]
        used = [*self.chunks[: self._head], *chunks[:EVENT_CHUNKS_MAX]]
        with self.path.open("rb") as stream, refusing_damage(stream.name):
            return self._read(stream, 0.0, math.inf, used).events

    @property
    def _start_utc_ns(self) -> int:
        return self.start_ns + self.layout.utc_offset_ns

    def _scan(self, stream: BinaryIO) -> None:
        for count, place in enumerate(places(stream)):
            if count >= RECORDS_MAX or len(self._fixed) > METADATA_MAX:
                raise RecordingError(f"{stream.name} has too many records to be shown")
            if place.opcode in (METADATA, DATA_END):
                if place.end - place.offset > LARGEST_CHUNK:
                    return
                self._fixed.append(place)
            elif place.opcode == CHUNK:
                stream.seek(place.offset)
                head = stream.read(CHUNK_HEAD.size)
                if place.end - place.offset > LARGEST_CHUNK or len(head) < CHUNK_HEAD.size:
                    return
                _, _, first, last, _ = CHUNK_HEAD.unpack(head)
                self.chunks.append(ChunkPlace(place, first, last, ()))
            elif place.opcode == MESSAGE_INDEX and self.chunks:
                stream.seek(place.offset + HEAD.size)
                channel = int.from_bytes(stream.read(CHANNEL_BYTES), "little")
                chunk = self.chunks[-1]
                self.chunks[-1] = chunk._replace(channels=(*chunk.channels, channel))

    def _find_head(self, stream: BinaryIO) -> int:
        """Return the number of chunks up to the first one with a cycle."""
        for count in range(1, min(len(self.chunks), HEAD_MAX) + 1):
            reader = PartReader(stream, 0.0, 0.0)
            reader.read(self._records(self.chunks[:count]))
            if reader.has_cycles:
                return count
        raise RecordingError(f"{stream.name} has no cycle at its start")

    def _find_event_channel(self, stream: BinaryIO, layout: Layout) -> int | None:
        """Return the number of the channel of the events; None if it is not described."""
        reader = PartReader(stream, 0.0, 0.0)
        reader.read(self._records(self.chunks[: self._head]))
        return reader.channel(topic(layout, "events"))

    def _read(
        self, stream: BinaryIO, start: float, end: float, chunks: list[ChunkPlace]
    ) -> Recording:
        return PartReader(stream, start, end).read(self._records(chunks))

    def _records(self, chunks: list[ChunkPlace]) -> list[Place]:
        return sorted({*self._fixed, *(chunk.place for chunk in chunks)}, key=lambda p: p.offset)
