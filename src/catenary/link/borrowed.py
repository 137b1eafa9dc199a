"""Borrowed link: a link for a wrapper that ends before the link does."""

from __future__ import annotations

from typing import Self

from catenary.errors import LinkError
from catenary.link._table import explained_by
from catenary.link.protocol import Link


class BorrowedLink:
    """Link that belongs to another object. `close` has no effect; the owner closes the link."""

    def __init__(self, link: Link) -> None:
        self.link = link

    @property
    def name(self) -> str:
        """Name of the link."""
        return self.link.name

    @property
    def capsule(self) -> object:
        """Capsule of the link."""
        return self.link.capsule

    def send(self, frame: bytes) -> None:
        """Send one frame."""
        self.link.send(frame)

    def receive(self) -> bytes | None:
        """Return the oldest received frame; None if no frame has arrived."""
        return self.link.receive()

    def now(self) -> int:
        """Return the time of the link's clock [ns]."""
        return self.link.now()

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        """Wait until a deadline [ns], or until a frame arrives."""
        return self.link.wait_until(deadline_ns, wake_on_frame)

    def explain(self, number: int) -> LinkError | None:
        """Return the link's error for an errno; None if it cannot explain it."""
        return explained_by(self.link, number)

    def close(self) -> None:
        """Do nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()
