"""`catenary foxglove`: the cycles and events of a share for Foxglove and PlotJuggler, live.

The topics and messages are those of a recording (`catenary.record.channels`), in CDR, plus
`/NAME/diagnostics` once per second. The server speaks the protocol foxglove.sdk.v1. Clients can
only read. A message is encoded only while a client subscribes to its topic. For a slow client, the
server drops the oldest messages.
"""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import Any, Self

import msgspec
import numpy as np
import numpy.typing as npt

from catenary.errors import CatenaryError
from catenary.monitor.diagnostics import DIAGNOSTIC_ARRAY, encode_diagnostics
from catenary.monitor.extra import require
from catenary.monitor.snapshot import Summaries
from catenary.monitor.source import Source
from catenary.record.channels import Channel, encode_log, encode_text, make_channels, topic
from catenary.record.definitions import LOG, STRING, Definition
from catenary.record.file import level_of
from catenary.record.layout import TIME
from catenary.record.recorder import describe
from catenary.share import ShareLayout

INTERVAL = 0.02  # [s] between two reads of the share
DIAGNOSTICS_INTERVAL = 1.0  # [s]
BACKLOG = 4096  # messages per client; one second at 1 kHz
PORT = 8765

Rows = npt.NDArray[np.void]


class FoxgloveServer:
    """Owner of a WebSocket server that publishes one share.

        with FoxgloveServer("arm") as server:
            server.run()

    Args:
        name: name of the share.
        host: address to listen on. Any client that reaches it can read the share.
        port: TCP port; 0: any free one.
        uid: owner of the share (`cat.attach`).

    Raises:
        ShareError: The share cannot be opened.
        ConfigurationError: foxglove-sdk is not installed.
        CatenaryError: The address is not available.
    """

    def __init__(
        self, name: str, *, host: str = "127.0.0.1", port: int = PORT, uid: int | None = None
    ) -> None:
        self._library = require("foxglove", "foxglove")
        self._source = Source(name, uid)
        self._context = self._library.Context()
        try:
            self._server = self._library.start_server(
                name=f"Catenary {name}",
                host=host,
                port=port,
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except RuntimeError as error:
            self._source.close()
            raise CatenaryError(
                f"cannot listen on {host}:{port}: {error}", hint="choose another --port"
            ) from error
        self.port: int = self._server.port
        self._topics: Topics | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def run(self, stop: threading.Event | None = None) -> None:
        """Publish until `stop` is set. A loop that has ended is awaited."""
        stop = stop or threading.Event()
        while not stop.wait(INTERVAL):
            self.take()

    def take(self) -> None:
        """Publish the cycles and events since the last call."""
        reader = self._source.reader
        if self._topics is None or self._topics.run != reader.layout.run:
            self._close_topics()
            self._topics = Topics(self._library, self._context, reader)
        if not self._topics.take() and not reader.alive:
            self._source.attach_again()

    def close(self) -> None:
        """Stop the server and detach from the share."""
        self._close_topics()
        self._server.stop()
        self._source.close()

    def _close_topics(self) -> None:
        if self._topics is not None:
            self._topics.close()


class Topics:
    """Owner of the topics of one run of a loop.

    Args:
        library: module of foxglove-sdk.
        context: context of the server.
        reader: reader of the share.
    """

    def __init__(self, library: Any, context: Any, reader: Any) -> None:
        layout: ShareLayout = reader.layout
        self.run = layout.run
        self._library, self._context, self._reader = library, context, reader
        self._layout = describe(layout)
        self._number, self._serial = reader.number, 0
        self._summaries, self._next_diagnostics = Summaries(reader), 0.0
        self._channels = [
            (each, self._open(each.topic, each.definition)) for each in make_channels(self._layout)
        ]
        self._log = self._open(topic(self._layout, "log"), LOG)
        self._events = self._open(topic(self._layout, "events"), STRING)
        self._diagnostics = self._open(topic(self._layout, "diagnostics"), DIAGNOSTIC_ARRAY)

    def take(self) -> bool:
        """Publish the new cycles and events. Return False without a new cycle."""
        rows, _ = self._reader.rows(self._number)
        if len(rows):
            self._number = int(rows["number"][-1])
            self._publish(rows)
        self._publish_events()
        self._publish_diagnostics()
        return bool(len(rows))

    def close(self) -> None:
        """Remove the topics from the server."""
        own = (self._log, self._events, self._diagnostics)
        for channel in (*(channel for _, channel in self._channels), *own):
            channel.close()

    def _open(self, name: str, definition: Definition) -> Any:
        schema = self._library.Schema(
            name=definition.name, encoding="ros2msg", data=definition.text.encode()
        )
        return self._library.Channel(
            name, schema=schema, message_encoding="cdr", context=self._context
        )

    def _publish(self, rows: Rows) -> None:
        times = rows[TIME].astype(np.int64) + self._layout.utc_offset_ns
        for channel, out in self._channels:
            if out.has_sinks():
                for message, time_ns in zip(messages(channel, rows, times), times, strict=True):
                    out.log(message, log_time=int(time_ns))

    def _publish_events(self) -> None:
        """Publish the new events. Without a client, keep them for the first one."""
        if not (self._log.has_sinks() or self._events.has_sinks()):
            return
        events, _ = self._reader.events(self._serial)
        for event in events:
            self._serial = event.serial
            time_ns = round(event.time * 1e9) + self._layout.utc_offset_ns
            name, level = self._layout.name, level_of(event.kind)
            text = encode_log(time_ns, level, name, event.message, event.number)
            self._log.log(text, log_time=time_ns)
            data = msgspec.json.encode(event).decode()
            self._events.log(encode_text(data), log_time=time_ns)

    def _publish_diagnostics(self) -> None:
        now = time.monotonic()
        if now < self._next_diagnostics:
            return
        self._next_diagnostics = now + DIAGNOSTICS_INTERVAL
        summary = self._summaries.take()
        if summary is not None and self._diagnostics.has_sinks():
            time_ns = round(summary.time * 1e9) + self._layout.utc_offset_ns
            message = encode_diagnostics(self._layout.name, summary, time_ns)
            self._diagnostics.log(message, log_time=time_ns)


def messages(channel: Channel, rows: Rows, times_ns: npt.NDArray[np.int64]) -> list[bytes]:
    """Return the encoded messages of a channel, one per row.

    Args:
        channel: channel of a recording.
        rows: cycles.
        times_ns: UTC time of each row [ns].
    """
    data, size = channel.encode(rows, times_ns), len(channel.message.constant)
    return [data[n * size : (n + 1) * size] for n in range(len(rows))]
