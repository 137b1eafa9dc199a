"""Recording of a loop, read from a file, with its fields by name."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np
import numpy.typing as npt

from catenary.errors import RecordingError
from catenary.record.cdr import Rows
from catenary.record.channels import (
    FORMAT,
    OLD_FORMAT,
    decode_text,
    is_event,
    make_channels,
    ros_name,
    topic,
)
from catenary.record.layout import NUMBER, TIME, Layout
from catenary.record.mcap_records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    END_RECORD,
    LAYOUT_RECORD,
    METADATA,
    ChunkMessage,
    Place,
    chunk_bytes,
    chunk_messages,
    chunk_records,
    decode_record,
    places,
    read_record,
    refusing_damage,
)
from catenary.record.merged import MERGED_RECORD, end_record, select
from catenary.share import SharedEvent

LONGEST = 1e9  # [s] longer than any recording


@dataclass(frozen=True, slots=True)
class Recording:
    """The cycles of a loop, oldest first. `recording["position"]` has the shape (cycles, axes).

    `lost` is the number of cycles that the recorder missed. `ended` is the reason for the end of
    the recording. It is "cut off" if the file is truncated, for example by a killed recorder.
    """

    layout: Layout
    rows: Rows
    events: tuple[SharedEvent, ...]
    lost: int
    ended: str
    # Start of the whole recording, on the loop's clock; None: the first row.
    began_ns: int | None = None

    def __getitem__(self, field: str) -> npt.NDArray[Any]:
        if self.layout.field(field) is None:
            names = ", ".join(each.name for each in self.layout.fields)
            raise KeyError(f"{self.layout.name} has no field {field!r}; its fields are {names}")
        return self.rows[field]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def name(self) -> str:
        """Name of the loop."""
        return self.layout.name

    @property
    def period(self) -> float:
        """Period of the loop [s]."""
        return self.layout.period

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes, in the order of the columns."""
        return self.layout.axes

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """Time of each cycle [s] since the first cycle of the whole recording."""
        return np.asarray((self.rows[TIME] - self.start_ns) * 1e-9)

    @property
    def start_ns(self) -> int:
        """Time of the first cycle [ns] on the loop's clock; add layout.utc_offset_ns for UTC."""
        if self.began_ns is not None:
            return self.began_ns
        return int(self.rows[TIME][0]) if len(self.rows) else 0

    def unit(self, field: str) -> str:
        """Return the unit of a field; "" for a number without a unit or an unknown field."""
        found = self.layout.field(field)
        return found.unit if found is not None else ""


def read(
    path: str | os.PathLike[str],
    *,
    start: float = 0.0,
    end: float = np.inf,
    share: str | None = None,
) -> Recording:
    """Read a recording, or a part of it. A truncated file is read up to its last complete chunk.

    Args:
        path: the file.
        start: start of the part [s], counted from the first cycle; 0 includes earlier events.
        end: end of the part [s], counted from the first cycle.
        share: name of the share to read from a merged recording.

    Raises:
        RecordingError: The file is not a recording of Catenary, it is damaged, or the extra is not
            installed; or it is a merged recording and does not contain `share`.
        ValueError: `start` or `end` is not a valid time.
        OSError: The file cannot be read.
    """
    if not start <= LONGEST or math.isnan(end):
        raise ValueError(f"start={start} s and end={end} s must be valid times of a recording")
    with Path(path).open("rb") as stream, refusing_damage(stream.name):
        return PartReader(stream, start, end, share).read(places(stream))


class PartReader:
    """Reader of one file, which collects the messages of the requested part.

    Args:
        stream: the file.
        start: start of the part [s], counted from the first cycle.
        end: end of the part [s].
        share: name of the share; None if the file contains only one.
    """

    def __init__(
        self, stream: BinaryIO, start: float, end: float, share: str | None = None
    ) -> None:
        self._stream = stream
        self._share = share
        self._merged = ""  # name of the share in the topics of a merged file
        self._prefix = ""  # start of its topics in a file of its own
        self._part = (start, end)  # [s] after the first cycle
        self._metadata: dict[str, dict[str, str]] = {}
        self._topics: dict[int, str] = {}  # by channel id
        self._messages: dict[str, list[ChunkMessage]] = defaultdict(list)  # by topic
        self._span = (-math.inf, math.inf)  # log times of the part [ns]; set by the first cycle
        self._began: int | None = None  # log time of the first cycle [ns]
        self._complete = False  # True if the last record is the end of the data section

    @property
    def has_cycles(self) -> bool:
        """True if a cycle has been read, or skipped because it is outside of the part."""
        return self._began is not None

    def channel(self, topic: str) -> int | None:
        """Return the number of the channel of a topic; None if no chunk has described it."""
        return next((number for number, each in self._topics.items() if each == topic), None)

    def read(self, records: Iterable[Place]) -> Recording:
        """Read records up to the first damaged one.

        Args:
            records: places of records in the order of the file. They include the metadata, and
                all chunks up to the first one with a cycle.
        """
        for place in records:
            self._complete = place.opcode == DATA_END
            if place.opcode not in (METADATA, CHUNK):
                continue
            record = read_record(self._stream, place)
            if record is None:
                break
            if place.opcode == METADATA:
                self._read_metadata(record)
            elif not self._read_chunk(record):
                break
        return self._make()

    def _read_metadata(self, record: Any) -> None:
        if record.name != MERGED_RECORD:
            self._metadata[record.name] = record.metadata
            return
        self._merged, share = select(record.metadata, self._share, self._stream.name)
        self._prefix = topic(share.layout, "")
        layout = msgspec.json.encode(share.merged_layout).decode()
        self._metadata[LAYOUT_RECORD] = {"format": share.format, "layout": layout}

    def _own_topic(self, topic: str) -> str:
        """Return the topic as in a file of this share alone; "" if it is another share's."""
        if not self._merged:
            return topic
        prefix = f"/{self._merged}/"
        return self._prefix + topic.removeprefix(prefix) if topic.startswith(prefix) else ""

    def _read_chunk(self, chunk: Any) -> bool:
        """Read a chunk. Return False if it is damaged; the caller then ignores the rest."""
        first, last = self._span
        if chunk.message_start_time > last or chunk.message_end_time < first:
            return True
        data = chunk_bytes(chunk)
        if data is None:
            return False
        self._read_channels(data)
        for message in chunk_messages(data):
            if message.channel not in self._topics:
                return False  # the chunk with the description of the channel is missing
            if name := self._topics[message.channel]:
                self._read_message(name, message)
        return True

    def _read_message(self, topic: str, message: ChunkMessage) -> None:
        if self._span == (-math.inf, math.inf) and not is_event(topic):
            self._began = message.time_ns
            start, end = self._part
            # A part that starts at 0 includes the events before the first cycle.
            low = message.time_ns + round(start * 1e9) if start > 0 else -math.inf
            self._span = (low, message.time_ns + round(min(end, LONGEST) * 1e9))
        if self._span[0] <= message.time_ns <= self._span[1]:
            self._messages[topic].append(message)

    def _read_channels(self, data: bytes) -> None:
        for opcode, at, end in chunk_records(data):
            if opcode == CHANNEL:
                channel = decode_record(data[at:end])
                self._topics[channel.id] = self._own_topic(channel.topic)

    def _make(self) -> Recording:
        head = self._metadata.get(LAYOUT_RECORD)
        if head is None or head.get("format") not in (FORMAT, OLD_FORMAT):
            raise RecordingError(
                f"{self._stream.name} is not a recording of Catenary (format {FORMAT})",
                hint="read other MCAP files with the packages mcap and mcap-ros2-support",
            )
        layout = self._layout(head.get("layout", ""))
        self._require_share(layout.name)
        tail = self._metadata.get(end_record(self._merged) if self._merged else END_RECORD, {})
        messages = self._messages[topic(layout, "events")]
        texts = [decode_text(message.data) for message in messages]
        events = (msgspec.json.decode(text, type=SharedEvent) for text in texts)
        first = self._span[0]  # the part was unknown while events before the first cycle were read
        return Recording(
            layout=self._named(layout),
            rows=_rows(layout, self._messages, head["format"]),
            events=tuple(e for e in events if e.time * 1e9 + layout.utc_offset_ns >= first),
            lost=int(lost) if (lost := tail.get("lost", "0")).isdecimal() else 0,
            ended=tail.get("ended", "cut off") if self._complete else "cut off",
            began_ns=None if self._began is None else self._began - layout.utc_offset_ns,
        )

    def _require_share(self, name: str) -> None:
        if self._share is None or self._merged or ros_name(self._share) == ros_name(name):
            return
        raise RecordingError(
            f"{self._stream.name} is a recording of {name!r}, not of {self._share!r}"
        )

    def _named(self, layout: Layout) -> Layout:
        """Return the layout with the name in the merged file, if a merge replaced the name."""
        if self._merged in ("", ros_name(layout.name)):
            return layout
        return msgspec.structs.replace(layout, name=self._merged)

    def _layout(self, text: str) -> Layout:
        try:
            layout = msgspec.json.decode(text, type=Layout)
            make_channels(layout)
            numbers = [layout.dtype[name].kind for name in (TIME, NUMBER)]
        except (msgspec.MsgspecError, TypeError, ValueError, LookupError, MemoryError) as error:
            raise RecordingError(
                f"{self._stream.name}: the layout of its cycles is damaged: {error}"
            ) from error
        if not 0.0 < layout.period < math.inf or not set(numbers) <= set("iu"):
            raise RecordingError(
                f"{self._stream.name}: the layout of its cycles is damaged: period "
                f"{layout.period} s, dtype kinds {numbers} of {TIME} and {NUMBER}"
            )
        return layout


def _rows(layout: Layout, messages: Mapping[str, list[ChunkMessage]], format_: str) -> Rows:
    """Return the cycles whose messages are complete; a truncation may split the last cycle."""
    channels = make_channels(layout, format_)
    numbers = [
        np.array([message.sequence for message in messages[channel.topic]], np.int64)
        for channel in channels
    ]
    whole = reduce(np.intersect1d, numbers)
    rows = np.zeros(len(whole), layout.dtype)
    for channel, present in zip(channels, numbers, strict=True):
        chosen = np.flatnonzero(np.isin(present, whole))
        data = b"".join(messages[channel.topic][number].data for number in chosen)
        channel.decode(data, rows)
    return rows
