"""Writer of rows and events to an MCAP file with an index.

The file consists of chunks of about 0.5 s, compressed with zstd.

The MCAP library writes the file. This module encodes the messages.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from catenary.errors import RecordingError
from catenary.record.cdr import Rows
from catenary.record.channels import (
    ERROR,
    FORMAT,
    INFO,
    WARNING,
    Channel,
    encode_log,
    encode_text,
    make_channels,
    topic,
)
from catenary.record.definitions import LOG, STRING, Definition
from catenary.record.extra import require
from catenary.record.layout import NUMBER, TIME, Layout
from catenary.record.mcap_records import END_RECORD, LAYOUT_RECORD
from catenary.record.output import Output
from catenary.share import SharedEvent

INFO_KINDS = ("DeviceReturned", "LinkRestored", "ClockLocked", "Marker")
CHUNK_SECONDS = 0.5  # [s] approximate loss if the recorder is killed
SMALLEST_CHUNK, LARGEST_CHUNK = 1 << 14, 1 << 22  # [bytes]
SEQUENCE_MASK = 0xFFFFFFFF


class RecordingFile:
    """Owner of an MCAP file that is being written.

    `write`, `write_event` and `finish` raise OSError if the disk fails. The file is then
    truncated; `repair` makes it complete.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        layout: Layout,
        *,
        force: bool = False,
    ) -> None:
        """Create the file.

        Args:
            path: the file.
            layout: layout of the rows.
            force: replace an existing file.

        Raises:
            RecordingError: The file exists (without `force`), another recorder is writing it, a
                field cannot be recorded, or the extra is not installed.
            OSError: The file cannot be created or written.
        """
        library: Any = require("mcap.writer")
        self.layout = layout
        self._channels = make_channels(layout)
        self._output = _create(path, force)
        self._writer = library.Writer(self._output, chunk_size=chunk_size(layout, self._channels))
        try:
            self._writer.start("ros2", f"catenary; {library.LIBRARY_IDENTIFIER}")
            self._writer.add_metadata(LAYOUT_RECORD, self._describe())
        except OSError as error:
            self._output.close()
            raise OSError(error.errno, error.strerror, str(path)) from error
        self._schemas: dict[str, int] = {}
        self._ids = [self._register(each.topic, each.definition) for each in self._channels]
        self._log = self._register(topic(layout, "log"), LOG)
        self._events = self._register(topic(layout, "events"), STRING)

    def write(self, rows: Rows) -> None:
        """Write all messages of these rows in the order of their times."""
        times = rows[TIME].astype(np.int64) + self.layout.utc_offset_ns
        parts = [
            (number, channel.encode(rows, times), len(channel.message.constant))
            for number, channel in zip(self._ids, self._channels, strict=True)
        ]
        add = self._writer.add_message
        for n, time, sequence in zip(
            range(len(rows)), times.tolist(), rows[NUMBER].tolist(), strict=True
        ):
            for number, data, size in parts:
                message = data[n * size : (n + 1) * size]
                add(number, time, message, time, sequence & SEQUENCE_MASK)

    def write_event(self, event: SharedEvent) -> None:
        """Write an event twice: as a log message for people, and as JSON for programs."""
        time_ns = round(event.time * 1e9) + self.layout.utc_offset_ns
        level, number = level_of(event.kind), event.number
        text = encode_log(time_ns, level, self.layout.name, event.message, number)
        data = encode_text(msgspec.json.encode(event).decode())
        for channel, message in ((self._log, text), (self._events, data)):
            self._writer.add_message(channel, time_ns, message, time_ns, number & SEQUENCE_MASK)

    def finish(self, end: Mapping[str, object]) -> None:
        """Write `end` as metadata, write the index, and close the file."""
        self._writer.add_metadata(END_RECORD, {key: str(value) for key, value in end.items()})
        self._writer.finish()
        self._output.close()

    def close(self) -> None:
        """Close the file without an index. A no-op after `finish`."""
        self._output.close()

    def _describe(self) -> dict[str, str]:
        return {
            "format": FORMAT,
            "layout": msgspec.json.encode(self.layout).decode(),
        }

    def _register(self, topic: str, definition: Definition) -> int:
        if definition.name not in self._schemas:
            self._schemas[definition.name] = self._writer.register_schema(
                definition.name, "ros2msg", definition.text.encode()
            )
        schema = self._schemas[definition.name]
        return int(self._writer.register_channel(topic, "cdr", schema))


def level_of(kind: str) -> int:
    """Return the log level of an event kind.

    An error ends the loop. Recoveries and markers are only information. All other events are
    warnings.
    """
    if kind.endswith("Error"):
        return ERROR
    return INFO if kind in INFO_KINDS else WARNING


def chunk_size(layout: Layout, channels: list[Channel]) -> int:
    """Return the uncompressed size of a chunk [bytes]: CHUNK_SECONDS of cycles, within bounds."""
    record = 31  # header of an MCAP message record
    cycle = sum(len(channel.message.constant) + record for channel in channels)
    return min(max(int(cycle * CHUNK_SECONDS / layout.period), SMALLEST_CHUNK), LARGEST_CHUNK)


def _create(path: str | os.PathLike[str], force: bool) -> Output:
    try:
        return Output(path, force=force)
    except FileExistsError as error:
        raise RecordingError(
            f"{Path(path)} already exists",
            hint="use another name, or replace the file with --force (force=True)",
        ) from error
