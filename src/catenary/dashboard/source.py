"""Connection to a share that may end, die, or return with another layout."""

from __future__ import annotations

import time
from collections.abc import Callable

from catenary.errors import CatenaryError, ShareError
from catenary.share import Reader, SharedEvent, attach
from catenary.share.folder import names

RETRY_SECONDS = 0.25  # between two attempts to attach
CHECK_SECONDS = 0.25  # between two checks of the program of the loop
STALL_SECONDS = 0.5  # without a new cycle
GONE = {
    "ended": "the loop of the share {name!r} has ended",
    "dead": "the program of the share {name!r} has died ({writer})",
}


class Source:
    """Owner of the reader of a share. It attaches again after the share has ended.

    All times are from `clock`, which must be monotonic.

    Args:
        name: name of the share.
        uid: owner of the share; None: this user or root.
        clock: clock [s].
    """

    def __init__(
        self, name: str, *, uid: int | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.name = name
        self.reader: Reader | None = None
        self.reason = f"no attempt to attach to the share {name!r} yet"
        self.reason_no_jog: str | None = None
        self._uid = uid
        self._clock = clock
        self._next = 0.0  # time of the next attempt or check
        self._ended_run = ""
        self._number = 0
        self._news = clock()
        self._event = 0

    def step(self) -> bool:
        """Attach, or check the share, if it is time. Return True if `reader` has changed."""
        now = self._clock()
        if now < self._next:
            return False
        if self.reader is None:
            self._next = now + RETRY_SECONDS
            return self._attach()
        self._next = now + CHECK_SECONDS
        return self._check(self.reader)

    def close(self) -> None:
        """Detach from the share."""
        if self.reader is not None:
            self.reader.close()
            self.reader = None

    def drop(self, reason: str) -> None:
        """Detach from a damaged share, and attach again only to a later run."""
        if self.reader is not None:
            self._ended_run = self.reader.layout.run
        self.reason = reason
        self.close()

    def silent(self) -> float:
        """Return the time since the last new cycle [s]; 0 while no share exists."""
        if self.reader is None:
            return 0.0
        now = self._clock()
        if self.reader.number != self._number:
            self._number, self._news = self.reader.number, now
        return now - self._news

    def is_stalled(self) -> bool:
        """Return True if the share exists, but no new cycle has come for STALL_SECONDS."""
        return self.reader is not None and self.silent() > max(
            STALL_SECONDS, 5 * self.reader.layout.period
        )

    def new_events(self) -> list[SharedEvent]:
        """Return the events since the last call; after an attachment, all stored events."""
        if self.reader is None:
            return []
        try:
            events, _ = self.reader.events(self._event)
        except ShareError as error:
            return [self._damaged(str(error))]
        if events:
            self._event = events[-1].serial
        return events

    def _attach(self) -> bool:
        try:
            reader = attach(self.name, uid=self._uid)
        except ShareError as error:
            self.reason = error.message
            return False
        if reader.layout.run == self._ended_run:
            reader.close()
            return False
        self.reader = reader
        self._number, self._news, self._event = reader.number, self._clock(), 0
        self.reason_no_jog = reason_no_commands(reader)
        return True

    def _check(self, reader: Reader) -> bool:
        state = reader.state
        if state == "running":
            return False
        writer = reader.layout.writer
        self.drop(GONE[state].format(name=self.name, writer=writer))
        return True

    def _damaged(self, message: str) -> SharedEvent:
        self._event += 1
        return SharedEvent(self._event, 0, "ShareError", message, 0.0, None, {})


def reason_no_commands(reader: Reader) -> str | None:
    """Return why the program of a share accepts no jogs from this user; None if it does."""
    try:
        _ = reader.token  # opens the desk, so that a later stop need not
    except CatenaryError as error:
        return error.message
    return None if reader.layout.jog else "the program has opened its share without jog=True"


def existing_shares(uid: int | None = None) -> list[str]:
    """Return the names of the shares of a user; None: this user."""
    return names(uid)
