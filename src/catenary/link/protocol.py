"""What a link and a link source are, for those who write or use one."""

from __future__ import annotations

from typing import Protocol, Self, runtime_checkable


@runtime_checkable
class Link(Protocol):
    """Carries whole Ethernet frames (destination MAC first, no FCS); one thread at a time.

    `capsule` holds the `cat_link` table of `native/link.h`: the same four calls without Python.
    """

    @property
    def name(self) -> str: ...

    @property
    def capsule(self) -> object: ...

    def send(self, frame: bytes) -> None:
        """Sends one frame; `LinkError` where the device does not take it."""
        ...

    def receive(self) -> bytes | None:
        """The oldest frame received, without waiting; None: none there."""
        ...

    def now(self) -> int:
        """The link's clock [ns]."""
        ...

    def wait_until(self, deadline_ns: int, wake_on_frame: bool) -> bool:
        """Waits until `deadline_ns` on the link's clock; True: a frame came first.

        Frames are looked for only with `wake_on_frame`.
        """
        ...

    def close(self) -> None: ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *exc_info: object) -> None: ...


@runtime_checkable
class LinkSource(Protocol):
    """Anything a MainDevice can be opened on: `Interface`, a virtual segment, an open link."""

    def open_link(self) -> Link: ...


def open_link(source: Link | LinkSource) -> Link:
    """The link of a source; an open link as it is."""
    return source.open_link() if isinstance(source, LinkSource) else source
