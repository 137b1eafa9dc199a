"""Protocols for links and link sources."""

from __future__ import annotations

from typing import Protocol, Self, runtime_checkable


@runtime_checkable
class Link(Protocol):
    """A carrier of complete Ethernet frames: destination MAC first, no FCS.

    Only one thread may use it at a time. `capsule` holds the `cat_link` table of `native/link.h`,
    which has the same four calls for compiled code.
    """

    @property
    def name(self) -> str: ...

    @property
    def capsule(self) -> object: ...

    def send(self, frame: bytes) -> None:
        """Send one frame.

        Raises:
            LinkError: The link cannot send the frame.
        """
        ...

    def receive(self) -> bytes | None:
        """Return the oldest received frame, without waiting; None if no frame has arrived.

        Raises:
            LinkError: The link has failed or is closed.
        """
        ...

    def now(self) -> int:
        """Return the time of the link's clock [ns]."""
        ...

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        """Wait until a deadline, or until a frame arrives.

        Args:
            deadline_ns: Absolute deadline on the link's clock [ns].
            wake_on_frame: True to return early when a frame arrives.

        Returns:
            True if a frame has arrived; always False without `wake_on_frame`.

        Raises:
            LinkError: The link has failed or is closed.
        """
        ...

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc_info: object) -> None: ...


@runtime_checkable
class LinkSource(Protocol):
    """An object that can open a link: an `Interface`, a virtual segment or an open link."""

    def open_link(self) -> Link: ...


def open_link(source: Link | LinkSource) -> Link:
    """Open the link of a source; return an open link unchanged."""
    return source.open_link() if isinstance(source, LinkSource) else source
