"""Jogs and state requests of one client, through leases on the desk of the loop.

The methods block: they lock the mutex of the desk. Call them in a worker thread.
Only `changes`, `refusals` and `forget` do not lock.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

from catenary.dashboard.messages import Beat, Press, Release, Request
from catenary.errors import CatenaryError
from catenary.share import Jog, JogStatus, Lease, Reader, RequestStatus, StateRequest, Sweep

LEASE_SECONDS = 1.0
REQUESTS_MAX = 64  # requests without an answer
REFUSED_FROM = RequestStatus.REFUSED_NOT_ALLOWED


@dataclass(slots=True)
class Held:
    """A jog that has not ended, with its lease and its last known status."""

    press: int
    lease: Lease
    jog: Jog
    status: JogStatus = JogStatus.NONE


@dataclass(frozen=True, slots=True)
class JogChange:
    """New status of a jog."""

    axis: int
    press: int
    status: JogStatus


class Motion:
    """Owner of the jogs of one client, at most one for each axis, and of its state requests."""

    def __init__(self) -> None:
        self._held: dict[int, Held] = {}
        self._requests: list[StateRequest] = []
        self._turn = threading.Lock()
        self._closed = False

    def press(self, reader: Reader, message: Press) -> None:
        """Start a jog; a former jog of the axis is released.

        Args:
            reader: reader of the share.
            message: the request, with the token that the browser echoes.

        Raises:
            CatenaryError: the axis is leased to another client, or the loop has ended.
            ValueError: a value is out of range.
        """
        with self._turn:
            if not self._closed:
                self._end(message.axis)
                self._held[message.axis] = self._begin(reader, message)

    def _begin(self, reader: Reader, message: Press) -> Held:
        given = message.sweep
        sweep = None if given is None else Sweep(given.start, given.end, given.duration)
        lease = reader.lease([message.axis], for_=LEASE_SECONDS)
        try:
            jog = lease.jog(
                reader.layout.axes[message.axis],
                message.velocity,
                distance=message.distance,
                acceleration=message.acceleration,
                sweep=sweep,
                token=int(message.token),
            )
        except BaseException:
            lease.release()
            raise
        return Held(message.press, lease, jog)

    def beat(self, message: Beat) -> None:
        """Pass the token that the browser echoed. A beat of an ended jog has no effect."""
        held = self._held.get(message.axis)
        if held is not None and held.press == message.press:
            held.jog.beat(int(message.token))

    def release(self, message: Release) -> None:
        """Release a jog. A release of an ended jog has no effect."""
        held = self._held.get(message.axis)
        if held is not None and held.press == message.press:
            held.jog.release()

    def changes(self) -> list[JogChange]:
        """Return the jogs whose status has changed since the last call."""
        changed = []
        for axis, held in list(self._held.items()):
            status = held.jog.status
            if status != held.status:
                held.status = status
                changed.append(JogChange(axis, held.press, status))
        return changed

    def end(self, change: JogChange) -> None:
        """Release a jog and its lease. A no-op if the axis has another jog since then."""
        with self._turn:
            held = self._held.get(change.axis)
            if held is not None and held.press == change.press:
                self._end(change.axis)

    def _end(self, axis: int) -> None:
        held = self._held.pop(axis, None)
        if held is not None:
            try:
                held.jog.release()
            finally:
                held.lease.release()

    def end_all(self) -> list[str]:
        """Release all jogs, and accept no more. Return the messages of releases that failed."""
        problems = []
        with self._turn:
            self._closed = True
            for axis in list(self._held):
                try:
                    self._end(axis)
                except CatenaryError as error:
                    problems.append(error.message)
        return problems

    def forget(self) -> None:
        """Drop all jogs and requests, because the loop has ended."""
        self._held.clear()
        self._requests.clear()

    def request(self, reader: Reader, message: Request) -> None:
        """Request a state for axes. `refusals` returns the answer of the core.

        Args:
            reader: reader of the share.
            message: the state and the axes.

        Raises:
            CatenaryError: an axis is leased to another client, or the loop has ended.
            ValueError: an axis does not exist.
        """
        with reader.lease(message.axes, for_=LEASE_SECONDS) as lease:
            self._requests.append(lease.request(message.state))

    def refusals(self) -> list[str]:
        """Return the texts of the requests that the core has refused since the last call."""
        waiting, texts = [], []
        for request in self._requests:
            status = request.status
            if RequestStatus.PENDING in status:
                waiting.append(request)
            texts += sorted({each.text for each in status if each >= REFUSED_FROM})
        self._requests = waiting[-REQUESTS_MAX:]
        return texts
