"""Distribution of the cycles and events of a share to all clients."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING

import msgspec

from catenary.dashboard.messages import encode_message
from catenary.dashboard.source import Source
from catenary.dashboard.status import AxisNotes, axis_statuses, cycle_status
from catenary.dashboard.subscriptions import Subscriptions
from catenary.errors import CatenaryError
from catenary.share import Reader, SharedEvent

if TYPE_CHECKING:
    from catenary.dashboard.client import Client
    from catenary.dashboard.requests import Requests

TICK = 1 / 60  # [s]
STATUS_INTERVAL = 0.05  # [s]
TIMING_INTERVAL = 0.5  # [s]
CLIENTS_MAX = 32
EVENTS_KEPT = 256


class Hub:
    """Owner of the source, the subscriptions and the clients. Use it in the event loop only.

    Args:
        source: connection to the share.
        requests: connection to the program of the loop.
        problem: returns the error of the program, or "".
    """

    def __init__(
        self, source: Source, requests: Requests, problem: Callable[[], str] = str
    ) -> None:
        self.source = source
        self.requests = requests
        self.subscriptions: Subscriptions | None = None
        self.clients: set[Client] = set()
        self._problem = problem
        self._notes = AxisNotes()
        self._events: list[SharedEvent] = []
        self._token = 0
        self._status_due = self._timing_due = 0.0
        self._tasks: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve the clients until the task is cancelled."""
        try:
            while True:
                self.step(time.monotonic())
                await asyncio.sleep(TICK)
        finally:
            self.source.close()

    def step(self, now: float) -> None:
        """Send what is due. `now` is a monotonic time [s]."""
        if self.source.step():
            self._change()
        reader = self.source.reader
        if reader is None:
            return
        self._send_events()
        if self.subscriptions is not None:
            self.subscriptions.deliver(reader, now)
        self._send_token(reader)
        for client in list(self.clients):
            client.follow_motion()
        if now >= self._status_due:
            self._status_due = now + STATUS_INTERVAL
            self._send_status(reader)
        if now >= self._timing_due and self.clients:
            self._timing_due = now + TIMING_INTERVAL
            self._start(self._send_timing())

    def add(self, client: Client) -> bool:
        """Add a client and send the present state. Return False if there are too many."""
        if len(self.clients) >= CLIENTS_MAX:
            return False
        self.clients.add(client)
        self._greet(client)
        return True

    def remove(self, client: Client) -> None:
        """Remove a client and its subscriptions."""
        self.clients.discard(client)
        if self.subscriptions is not None:
            self.subscriptions.remove(client)

    def event_rows(self) -> list[dict[str, object]]:
        """Return the newest events, oldest first."""
        return [msgspec.structs.asdict(event) for event in self._events]

    def _change(self) -> None:
        """Tell all clients that the share has ended or returned."""
        reader = self.source.reader
        self._notes, self._events, self._token = AxisNotes(), [], 0
        self.subscriptions = None if reader is None else Subscriptions(reader.layout)
        self.requests.reset()
        if reader is not None:
            self._start(self._find_devices())
        for client in list(self.clients):
            client.forget_motion()
            self._greet(client)

    def _greet(self, client: Client) -> None:
        reader = self.source.reader
        if reader is None:
            client.send(encode_message("gone", reason=self._problem() or self.source.reason))
            return
        client.send(self._hello(reader, client))
        for event in self._events:
            client.send(event_message(event))

    def _hello(self, reader: Reader, client: Client) -> str:
        layout = reader.layout
        return encode_message(
            "hello",
            share=layout.name,
            layout={
                "fields": [
                    {"name": f.name, "unit": f.unit, "shape": f.shape, "per_axis": f.per_axis}
                    for f in layout.fields
                ],
                "axes": layout.axes,
                "period": layout.period,
                "clock": layout.clock,
                "utc_offset_ns": layout.utc_offset_ns,
            },
            run=layout.run,
            role=client.role,
            reason_no_jog=client.reason_no_jog(),
            program=str(layout.writer),
            remote=self.requests.is_available(),
        )

    def _send_events(self) -> None:
        for event in self.source.new_events():
            self._notes.add(event)
            self._events = [*self._events[1 - EVENTS_KEPT :], event]
            self._send_all(event_message(event))

    def _send_token(self, reader: Reader) -> None:
        if self.source.reason_no_jog is not None:
            return
        try:
            token = reader.token
        except CatenaryError as error:
            self.source.reason_no_jog = error.message
            return
        if token != self._token:
            self._token = token
            text = encode_message("token", token=str(token))
            for client in self.clients:
                if client.role == "operator":
                    client.send(text)

    def _send_status(self, reader: Reader) -> None:
        if not self.clients or reader.number == 0:
            return
        row = reader.read()
        silent = self.source.silent()
        text = encode_message(
            "status",
            state="stalled" if self.source.is_stalled() else "running",
            silent=silent,
            axes=axis_statuses(row, reader.layout, self._notes),
            clients=len(self.clients),
            **cycle_status(row),
        )
        for client in self.clients:
            client.outbox.put_if_idle(text)

    async def _send_timing(self) -> None:
        try:
            timing = await self.requests.call("timing", {"histograms": True})
        except (CatenaryError, OSError):
            return  # the page shows that the program does not answer
        self._send_all(encode_message("timing", **msgspec.to_builtins(timing)))

    async def _find_devices(self) -> None:
        """Note the device of each axis, for the texts of faults."""
        notes = self._notes
        try:
            axes = await self.requests.call("axes", {})
        except (CatenaryError, OSError):
            return  # without it, the text of a fault does not name the error code
        notes.devices = {axis["name"]: axis["device"] for axis in msgspec.to_builtins(axes)}

    def _send_all(self, text: str) -> None:
        for client in self.clients:
            client.send(text)

    def _start(self, work: Coroutine[None, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def event_message(event: SharedEvent) -> str:
    """Return the message about an event."""
    content = msgspec.structs.asdict(event)
    return encode_message("event", advice="", **content)
