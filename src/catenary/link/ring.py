"""A ring of two links, as a link source."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.errors import ConfigurationError
from catenary.link._ring import RingLink
from catenary.link.protocol import Link, LinkSource

__all__ = ["Ring", "RingLink", "ring_of"]

PAIR_WAIT = 100e-6  # [s]; longer than the difference of both directions for a hundred devices


@dataclass(frozen=True, slots=True)
class Ring:
    """A ring of devices between two ports: `Ring(Interface("eth0"), Interface("eth1"))`.

    If a cable is cut, only the frames in transit are lost.

    Args:
        first: The link of one end, or its source.
        second: The link of the other end, or its source.
        pair_wait: Maximum time to wait for the second copy of a frame after the first [s].

    Raises:
        ConfigurationError: Both ends are the same.
    """

    first: Link | LinkSource
    second: Link | LinkSource
    pair_wait: float = PAIR_WAIT

    def __post_init__(self) -> None:
        if self.first == self.second:
            raise ConfigurationError(
                f"a ring needs two different ports; both are {self.first}",
                hint='give two different ports, MainDevice("eth0", "eth1"), or a single port',
            )

    def open_link(self) -> RingLink:
        """Open both links as one.

        Raises:
            LinkError: A link cannot be opened.
            ValueError: `pair_wait` is not from 0 to 1 s, or the two links cannot form a ring.
        """
        return RingLink(self.first, self.second, self.pair_wait)


def ring_of(link: Link) -> RingLink | None:
    """Return the RingLink that `link` is or wraps; None if it is not a ring."""
    while not isinstance(link, RingLink):
        inner = getattr(link, "link", None)
        if inner is None:
            return None
        link = inner
    return link
