"""The public MainDevice: takes the name of a segment, or a link source."""

from __future__ import annotations

from catenary import bus
from catenary.link import LinkSource
from catenary.target.parse import parse


class MainDevice(bus.MainDevice):
    """Owns the link to one segment: `MainDevice("eth0")`, `MainDevice("virtual")`,
    `MainDevice(Segment([...]))`.

        with cat.MainDevice("eth0") as main:
            for sub in main.scan():
                print(sub.position, sub.name, sub.identity, sub.state)

    Leaving the block brings all devices to INIT, whatever happened in it.
    """

    def __init__(self, target: str | LinkSource) -> None:
        super().__init__(parse(target) if isinstance(target, str) else target)
