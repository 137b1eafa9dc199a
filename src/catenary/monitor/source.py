"""Attachment to a share that may end and return, for example when its program restarts."""

from __future__ import annotations

from catenary.errors import ShareError
from catenary.monitor.snapshot import Summaries, Summary
from catenary.share import Reader, SharedEvent, attach


class Source:
    """Owner of the attachment to a share. It attaches again after the loop has ended.

    Args:
        name: name of the share.
        uid: owner of the share (`cat.attach`).

    Raises:
        ShareError: The share cannot be opened.
    """

    def __init__(self, name: str, uid: int | None = None) -> None:
        self.name = name
        self.reason = ""  # reason for a missing loop; "" while one runs
        self._uid = uid
        self._connect(attach(name, uid=uid))

    def _connect(self, reader: Reader) -> None:
        self.reader = reader
        self._summaries = Summaries(reader)
        self._serial = 0

    def take(self) -> Summary | None:
        """Return a summary of the new cycles; None without a new cycle. Attach again if needed."""
        summary = self._summaries.take()
        if summary is not None or self.reader.alive:
            self.reason = ""
            return summary
        self.reason = (
            "the loop has ended" if self.reader.state == "ended" else "the program has died"
        )
        self.attach_again()
        return None

    def events(self) -> list[SharedEvent]:
        """Return the events since the last call, oldest first."""
        events, _ = self.reader.events(self._serial)
        if events:
            self._serial = events[-1].serial
        return events

    def stop(self) -> None:
        """Request a quick stop of all axes. Raises ShareError if the loop has ended."""
        self.reader.stop()

    def close(self) -> None:
        """Detach from the share."""
        self.reader.close()

    def attach_again(self) -> None:
        """Attach to the share of a returned loop; a no-op if it has not returned yet."""
        try:
            reader = attach(self.name, uid=self._uid)
        except ShareError:
            return
        self.reader.close()
        self._connect(reader)
