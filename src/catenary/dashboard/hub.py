"""Distribution of the cycles and events of a share to all clients."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import msgspec

from catenary.dashboard.companions import Companions, stop
from catenary.dashboard.messages import encode_message
from catenary.dashboard.outbox import Outbox
from catenary.dashboard.requests import FAILURES, Requests
from catenary.dashboard.scene_feed import SceneFeed
from catenary.dashboard.security import Role
from catenary.dashboard.source import Source
from catenary.dashboard.status import AxisNotes, axis_statuses, cycle_status
from catenary.dashboard.subscriptions import Subscriptions
from catenary.errors import CatenaryError, ShareError
from catenary.share import Reader, SharedEvent

log = logging.getLogger(__name__)
TICK = 1 / 60  # [s]
POSES_INTERVAL = 1 / 30  # [s]
STATUS_INTERVAL = 0.05  # [s]
TIMING_INTERVAL = 0.5  # [s]
CLIENTS_MAX = 32
RESERVED = 8  # of these clients, for operators
SPARE = 8  # threads for clients that are leaving
EVENTS_KEPT = 256
ADVICE_SECONDS = 1.0  # limit for the advice of new events


class Client(Protocol):
    """Part of a client that the hub needs."""

    role: Role
    outbox: Outbox
    wants_poses: bool

    def reason_no_jog(self) -> str | None:
        """Return why the client cannot jog; None if it can."""

    def follow_motion(self) -> None:
        """Report changes of the jogs of the client."""

    def forget_motion(self) -> None:
        """Drop the jogs of the client."""


class Hub:
    """Owner of the source, the subscriptions and the clients. Use it in the event loop only.

    Args:
        source: connection to the share.
        requests: connection to the program of the loop.
        problem: returns the error of the program, or "".
        scene: 3D scene; None: there is none.
        companions: further shares of the machine; None: there are none.
    """

    def __init__(
        self,
        source: Source,
        requests: Requests,
        problem: Callable[[], str] = str,
        scene: SceneFeed | None = None,
        companions: Companions | None = None,
    ) -> None:
        self.source = source
        self.requests = requests
        self.subscriptions: Subscriptions | None = None
        self.clients: set[Client] = set()
        self._problem = problem
        self._reason = ""
        # Locks of the desk must not wait for requests to devices, so motion has its own threads.
        self.workers = ThreadPoolExecutor(CLIENTS_MAX + SPARE, "dashboard motion")
        self._notes = AxisNotes()
        self._events: list[dict[str, object]] = []
        self._fresh: list[SharedEvent] = []
        self._advising = False
        self._token = 0
        self.scene = scene
        self.companions = companions or Companions()
        self._status_due = self._timing_due = self._poses_due = 0.0
        self._tasks: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve the clients until the task is cancelled."""
        try:
            due = time.monotonic()
            while True:
                now = time.monotonic()
                self._step_or_drop(now)
                due = max(due + TICK, now)  # without catching up after a pause
                await asyncio.sleep(due - time.monotonic())
        finally:
            self.source.close()
            self.companions.close()
            self.requests.close()
            self.workers.shutdown(wait=False)

    def _step_or_drop(self, now: float) -> None:
        """Send all due messages. After an error, detach from the share and notify all clients."""
        try:
            self.step(now)
        except ShareError as error:
            self.source.drop(error.message)
            self._change()
        except Exception as error:
            log.exception("the server cannot show the share %r", self.source.name)
            self.source.drop(f"the server cannot show the share: {error!r}")
            self._change()

    def step(self, now: float) -> None:
        """Send all due messages. `now` is a monotonic time [s]."""
        self.companions.step()
        if self.source.step():
            self._change()
        reader = self.source.reader
        if reader is None:
            self._send_reason()
            return
        self._take_events()
        if self.subscriptions is not None:
            self.subscriptions.deliver(reader, now)
        self._send_token(reader)
        self._send_poses(now)
        for client in list(self.clients):
            client.follow_motion()
        if now >= self._status_due - TICK / 2:
            self._status_due = max(self._status_due + STATUS_INTERVAL, now)
            self._send_status(reader)
        if now >= self._timing_due and self.clients:
            self._timing_due = now + TIMING_INTERVAL
            self._start(self._send_timing())

    @property
    def readers(self) -> list[Reader]:
        """Readers of the shares with axes; empty if the share of the page does not exist."""
        reader = self.source.reader
        return [] if reader is None else [reader, *self.companions.networks]

    def stop(self) -> None:
        """Stop all axes of the share and of the further networks. Try all of them.

        Raises ShareError with the names of the shares that the stop did not reach.
        """
        failures = []
        try:
            stop(self.source)
        except CatenaryError as error:
            failures.append(f"{self.source.name!r}: {error.message}")
        failures += self.companions.stop()
        if failures:
            raise ShareError(
                f"the stop did not reach {'; '.join(failures)}",
                hint="stop these axes in another way, for example with the emergency stop",
            )

    def add(self, client: Client) -> bool:
        """Add a client and send the present state. Return False if there are too many."""
        limit = CLIENTS_MAX if client.role == "operator" else CLIENTS_MAX - RESERVED
        if len(self.clients) >= limit:
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
        return list(self._events)

    def _change(self) -> None:
        """Forget the previous run, and greet all clients if the share has returned."""
        reader = self.source.reader
        self._notes, self._events, self._fresh, self._token = AxisNotes(), [], [], 0
        self.subscriptions = None if reader is None else Subscriptions(reader.layout)
        self.requests.reset()
        if reader is not None:
            self._start(self._find_devices())
        self._reason = ""
        for client in list(self.clients):
            client.forget_motion()
            client.outbox.drop_frames()
            if reader is not None:
                self._greet(client)

    def _send_reason(self) -> None:
        """Send the reason for a missing share, if it has changed."""
        reason = self._problem() or self.source.reason
        if reason != self._reason:
            self._reason = reason
            self._send_all(encode_message("gone", reason=reason))

    def _greet(self, client: Client) -> None:
        reader = self.source.reader
        if reader is None:
            client.outbox.put_text(
                encode_message("gone", reason=self._problem() or self.source.reason)
            )
            return
        client.outbox.put_text(self._hello(reader, client))
        for event in self._events:
            client.outbox.put_text(encode_message("event", **event))

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
            modes=layout.modes,
            presets=layout.presets,
        )

    def _take_events(self) -> None:
        """Note new events, and send them when their advice is known."""
        events = self.source.new_events()
        for event in events:
            self._notes.add(event)
        self._fresh += events
        if self._fresh and not self._advising:
            self._start(self._send_events(self._fresh))
            self._fresh = []

    async def _send_events(self, events: list[SharedEvent]) -> None:
        """Send events with the advice of the program; without advice if it does not answer."""
        self._advising, notes = True, self._notes
        try:
            advice = await self._advice(events[0].serial - 1)
        finally:
            self._advising = False
        if notes is not self._notes:
            return  # the share has changed
        for event in events:
            row = {**msgspec.structs.asdict(event), "advice": advice.get(event.serial, "")}
            self._events = [*self._events[1 - EVENTS_KEPT :], row]
            self._send_all(encode_message("event", **row))

    async def _advice(self, after: int) -> dict[int, str]:
        """Return the advice for the events after a serial number."""
        if not self.requests.is_available():
            return {}
        try:
            found = await self.requests.call("events", {"after": after}, timeout=ADVICE_SECONDS)
        except FAILURES:
            return {}
        return {each["serial"]: each["advice"] for each in msgspec.to_builtins(found)["events"]}

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
                    client.outbox.put_text(text)

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
            mode=reader.mode,
            **cycle_status(row),
        )
        for client in self.clients:
            client.outbox.put_if_idle(text)

    def _send_poses(self, now: float) -> None:
        wanting = [client for client in self.clients if client.wants_poses]
        if self.scene is None or not wanting or now < self._poses_due:
            return
        self._poses_due = now + POSES_INTERVAL
        try:
            data = self.scene.poses(self.readers, self.companions.base)
        except ShareError:
            return  # a share is damaged; the 3D view keeps its last poses
        for client in wanting if data else ():
            client.outbox.put_latest(data)

    async def _send_timing(self) -> None:
        try:
            timing = await self.requests.call("timing", {"histograms": True})
        except FAILURES:
            return  # the page shows that the program does not answer
        self._send_all(encode_message("timing", **msgspec.to_builtins(timing)))

    async def _find_devices(self) -> None:
        """Note the device of each axis, for the texts of faults."""
        notes = self._notes
        try:
            axes = await self.requests.call("axes", {})
        except FAILURES:
            return  # without it, the text of a fault does not name the error code
        notes.devices = {axis["name"]: axis["device"] for axis in msgspec.to_builtins(axes)}

    def _send_all(self, text: str) -> None:
        for client in self.clients:
            client.outbox.put_text(text)

    def _start(self, work: Coroutine[None, None, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
