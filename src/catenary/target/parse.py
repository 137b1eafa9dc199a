"""Names of segments: "eth0", "virtual", "virtual:FILE.toml"."""

from __future__ import annotations

from catenary.errors import ConfigurationError
from catenary.link import Interface, LinkSource

VIRTUAL = "virtual"
IGH = "igh"


def parse(target: str) -> LinkSource:
    """The link source a name stands for; nothing is opened yet. A virtual segment is a new one
    each time. ConfigurationError for a name that cannot be."""
    kind, colon, rest = target.strip().partition(":")
    if kind == VIRTUAL and (rest or not colon):
        return _virtual(rest)
    if "," in target:
        raise ConfigurationError(
            f"{target!r} names a ring of two ports: this version drives one port",
            hint="give the first port alone; the segment then runs as a line",
        )
    if kind == IGH:
        raise ConfigurationError(
            f"{target!r} names a master of the IgH kernel module, which this version cannot use",
            hint="give the network interface itself, for instance eth0",
        )
    if not kind or colon or any(letter.isspace() or letter == "/" for letter in kind):
        raise ConfigurationError(
            f"{target!r} is no target",
            hint="give a network interface (eth0), virtual, or virtual:FILE.toml",
        )
    return Interface(kind)


def _virtual(path: str) -> LinkSource:
    from catenary.virtual import Segment, demo_segment  # a NIC needs none of it

    return Segment.from_toml(path) if path else demo_segment()
