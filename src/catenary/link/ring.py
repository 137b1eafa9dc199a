"""Two links as one ring, as a link source."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.errors import ConfigurationError
from catenary.link._ring import RingLink
from catenary.link.protocol import Link, LinkSource

__all__ = ["Ring", "RingLink", "ring_of"]

PAIR_WAIT = 100e-6  # [s]: the two ways round a hundred devices differ by less


@dataclass(frozen=True, slots=True)
class Ring:
    """A ring of devices between two ports: `Ring(Interface("eth0"), Interface("eth1"))`.

    One cut cable costs the frames that were on their way. `pair_wait` [s]: how long one copy of a
    frame waits for the other.
    """

    first: Link | LinkSource
    second: Link | LinkSource
    pair_wait: float = PAIR_WAIT

    def __post_init__(self) -> None:
        if self.first == self.second:
            raise ConfigurationError(
                f"{self.first}: the same port twice is no ring",
                hint='give two different ports, MainDevice("eth0", "eth1"), or one alone',
            )

    def open_link(self) -> RingLink:
        """Opens both."""
        return RingLink(self.first, self.second, self.pair_wait)


def ring_of(link: Link) -> RingLink | None:
    """The ring that a link is, or is wrapped round; None: there is none."""
    while not isinstance(link, RingLink):
        inner = getattr(link, "link", None)
        if inner is None:
            return None
        link = inner
    return link
