"""The public MainDevice: takes the name of a segment, or a link source."""

from __future__ import annotations

from catenary import bus
from catenary.link import LinkSource, Ring
from catenary.target.parse import parse


class MainDevice(bus.MainDevice):
    """Owns the link to one segment: `MainDevice("eth0")`, `MainDevice("virtual")`,
    `MainDevice(Segment([...]))`; `MainDevice("eth0", "eth1")` where the segment is a ring between
    two ports.

        with cat.MainDevice("eth0") as main:
            for sub in main.scan():
                print(sub.position, sub.name, sub.identity, sub.state)

    Leaving the block brings all devices to INIT, whatever happened in it.
    """

    def __init__(self, target: str | LinkSource, second: str | LinkSource | None = None) -> None:
        source = source_of(target)
        super().__init__(source if second is None else Ring(source, source_of(second)))


def source_of(target: str | LinkSource) -> LinkSource:
    """A name's link source, or the source itself."""
    return parse(target) if isinstance(target, str) else target
