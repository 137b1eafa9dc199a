"""Merge of recordings by time: one file with the messages of several loops or machines.

Messages keep their channels, and are sorted by their UTC times. The clocks of several machines must
therefore be synchronised, or the offset of each file must be known. The name of the share is the
first part of each topic. If two files have the same name, the names of the files replace it.
"""

from __future__ import annotations

import heapq
import os
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec

from catenary.errors import RecordingError
from catenary.record.channels import FORMAT, SECOND_NS, ros_name
from catenary.record.extra import require
from catenary.record.layout import Layout
from catenary.record.mcap_records import (
    CHUNK,
    END_RECORD,
    LAYOUT_RECORD,
    METADATA,
    add_descriptions,
    chunk_bytes,
    chunk_messages,
    places,
    read_record,
    refusing_damage,
)
from catenary.record.merged import MERGED_RECORD, MergedShare, end_record
from catenary.record.output import Output

STAMP = struct.Struct("<iI")  # seconds and nanoseconds, after the encapsulation header of CDR
STAMP_AT = 4
CHUNK_SIZE = 1 << 20  # [bytes]


@dataclass(frozen=True, slots=True)
class MergeInput:
    """A recording to merge.

    Args:
        path: the file.
        offset: time to add to its times [s]; positive if the clock of its machine was late.
    """

    path: str | os.PathLike[str]
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class Merged:
    """Result of a merge: number of messages of each topic, and the common duration [s]."""

    messages: dict[str, int]
    seconds: float


class TimedMessage(NamedTuple):
    """A message of a source, with its time in the merged file."""

    time_ns: int
    source: int
    channel: int
    sequence: int
    data: bytes


def merge(
    sources: Sequence[MergeInput | str | os.PathLike[str]],
    path: str | os.PathLike[str],
    *,
    force: bool = False,
) -> Merged:
    """Merge recordings into a new file. A truncated recording is used up to its last chunk.

    Args:
        sources: recordings, as paths or with their offsets.
        path: the new file.
        force: replace an existing file.

    Returns:
        Number of messages by topic, and the duration.

    Raises:
        RecordingError: A file is not a recording, is damaged, or has another kind of clock than the
            others; two names are equal; the new file exists (without `force`); or the extra is not
            installed.
        OSError: A file cannot be read or written.
    """
    inputs = [each if isinstance(each, MergeInput) else MergeInput(each) for each in sources]
    readers = [SourceReader(number, source) for number, source in enumerate(inputs)]
    _require_one_clock(readers)
    names = _names(readers)
    _require_new(path, force, [reader.path for reader in readers])
    return MergedFile(path, readers, names, force).write()


class SourceReader:
    """Reader of one recording, which yields its messages in the order of the file.

    Args:
        number: number of the source.
        source: file and offset.

    Raises:
        RecordingError: The file is not a recording of Catenary.
        OSError: The file cannot be read.
    """

    def __init__(self, number: int, source: MergeInput) -> None:
        self.path = Path(source.path)
        self.offset_ns = round(source.offset * 1e9)
        self.channels: dict[int, Any] = {}  # by number in the file; known once read
        self.schemas: dict[int, Any] = {}
        self.end: dict[str, str] = {}  # metadata of its end; known once read
        self._number = number
        with self.path.open("rb") as stream, refusing_damage(stream.name):
            self.layout, self.format = self._read_layout(stream)

    def messages(self) -> Iterator[TimedMessage]:
        """Yield the messages with shifted times, up to the first damaged record."""
        with self.path.open("rb") as stream, refusing_damage(stream.name):
            for place in places(stream):
                if place.opcode not in (METADATA, CHUNK):
                    continue
                record = read_record(stream, place)
                if record is None:
                    return
                if place.opcode == METADATA:
                    self._read_end(record)
                    continue
                data = chunk_bytes(record)
                if data is None:
                    return
                yield from self._read_chunk(data)

    def _read_end(self, record: Any) -> None:
        if record.name == END_RECORD:
            self.end = record.metadata

    def _read_chunk(self, data: bytes) -> Iterator[TimedMessage]:
        add_descriptions(self.schemas, self.channels, data)
        for message in chunk_messages(data):
            time_ns = message.time_ns + self.offset_ns
            content = self._shifted(message.channel, message.data)
            yield TimedMessage(time_ns, self._number, message.channel, message.sequence, content)

    def _shifted(self, channel: int, data: bytes) -> bytes:
        """Return the message with the offset added to its stamp, if it begins with one."""
        if not self.offset_ns or self.channels[channel].topic.endswith("/events"):
            return data
        seconds, nanoseconds = STAMP.unpack_from(data, STAMP_AT)
        moved = seconds * SECOND_NS + nanoseconds + self.offset_ns
        stamp = STAMP.pack(*divmod(moved, SECOND_NS))
        return data[:STAMP_AT] + stamp + data[STAMP_AT + STAMP.size :]

    def _read_layout(self, stream: BinaryIO) -> tuple[Layout, str]:
        """Return the layout and the version of the format."""
        for place in places(stream):
            if place.opcode == METADATA:
                record = read_record(stream, place)
                if record is not None and record.name == LAYOUT_RECORD:
                    layout = msgspec.json.decode(record.metadata["layout"], type=Layout)
                    return layout, record.metadata.get("format", FORMAT)
        raise RecordingError(
            f"{self.path} is not a recording of Catenary",
            hint="merge the files that `catenary record` wrote, not a merged file",
        )


class MergedFile:
    """Owner of the merged file while it is written."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        readers: Sequence[SourceReader],
        names: Sequence[str],
        force: bool,
    ) -> None:
        library: Any = require("mcap.writer")
        self._readers = readers
        self._names = names
        self._path = Path(path)
        self._output = Output(path, force=force)
        self._writer = library.Writer(self._output, chunk_size=CHUNK_SIZE)
        self._library = library.LIBRARY_IDENTIFIER
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[int, int], tuple[int, str]] = {}
        self._counts: Counter[str] = Counter()

    def write(self) -> Merged:
        """Write all messages and the index, and close the file."""
        first = last = 0
        try:
            self._writer.start("ros2", f"catenary; {self._library}")
            self._writer.add_metadata(MERGED_RECORD, self._describe())
            streams = [reader.messages() for reader in self._readers]
            for message in heapq.merge(*streams, key=lambda each: each.time_ns):
                if not self._channels:
                    self._register_all()
                first, last = first or message.time_ns, max(last, message.time_ns)
                self._add(message)
            self._add_ends()
            self._writer.finish()
        except BaseException:
            self._path.unlink()  # an incomplete file looks like a merge of shorter recordings
            raise
        finally:
            self._output.close()
        return Merged(dict(self._counts), (last - first) / SECOND_NS)

    def _register_all(self) -> None:
        """Register all channels before the first message, so that a part can be read alone."""
        for source, reader in enumerate(self._readers):
            for channel in reader.channels:
                self._channels[source, channel] = self._register(source, channel)

    def _add(self, message: TimedMessage) -> None:
        key = (message.source, message.channel)
        if key not in self._channels:
            self._channels[key] = self._register(*key)
        number, topic = self._channels[key]
        self._counts[topic] += 1
        time_ns = message.time_ns
        self._writer.add_message(number, time_ns, message.data, time_ns, message.sequence)

    def _add_ends(self) -> None:
        for name, reader in zip(self._names, self._readers, strict=True):
            if reader.end:
                self._writer.add_metadata(end_record(name), reader.end)

    def _register(self, source: int, channel: int) -> tuple[int, str]:
        """Register a channel of a source; return its number and its topic."""
        reader = self._readers[source]
        record = reader.channels[channel]
        schema = reader.schemas[record.schema_id]
        key = (schema.name, schema.data)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        topic = f"/{self._names[source]}/{record.topic.rpartition('/')[2]}"
        number = self._writer.register_channel(topic, record.message_encoding, self._schemas[key])
        return int(number), topic

    def _describe(self) -> dict[str, str]:
        """Return the description of each share, by name."""
        shares = [
            MergedShare(
                reader.path.name, reader.offset_ns / SECOND_NS, reader.layout, reader.format
            )
            for reader in self._readers
        ]
        texts = [msgspec.json.encode(share).decode() for share in shares]
        return dict(zip(self._names, texts, strict=True))


def _names(readers: Sequence[SourceReader]) -> list[str]:
    """Return the first part of the topics of each source; each name is used once."""
    names = [ros_name(reader.layout.name) for reader in readers]
    counts = Counter(names)
    unique = [
        name if counts[name] == 1 else ros_name(reader.path.stem)
        for name, reader in zip(names, readers, strict=True)
    ]
    twice = [name for name, count in Counter(unique).items() if count > 1]
    if twice:
        raise RecordingError(
            f"several recordings would have the name {twice[0]!r}",
            hint="rename the files: the name of a file replaces the name of its share",
        )
    return unique


def _require_one_clock(readers: Sequence[SourceReader]) -> None:
    if len(readers) < 2:
        raise RecordingError(f"{len(readers)} recordings: two or more are needed for a merge")
    kinds = {reader.layout.clock for reader in readers}
    if len(kinds) > 1:
        found = ", ".join(f"{reader.path}: {reader.layout.clock}" for reader in readers)
        raise RecordingError(
            f"the recordings have different clocks ({found})",
            hint="virtual time and the time of a machine have no common zero",
        )


def _require_new(path: str | os.PathLike[str], force: bool, inputs: Sequence[Path]) -> None:
    target = Path(path)
    if target.exists() and any(target.samefile(each) for each in inputs):
        raise RecordingError(f"{target} is also a recording to merge", hint="use another name")
    if target.exists() and not force:
        raise RecordingError(
            f"{target} already exists",
            hint="use another name, or replace the file with --force (force=True)",
        )
