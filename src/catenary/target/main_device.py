"""The public MainDevice, which accepts the name of a segment or a link source."""

from __future__ import annotations

from catenary import bus
from catenary.errors import ConfigurationError
from catenary.link import LinkSource, Ring
from catenary.target.parse import parse


class MainDevice(bus.MainDevice):
    """MainDevice of one segment: `MainDevice("eth0")`, `MainDevice("virtual")`.

    Further forms: `MainDevice(Segment([...]))`; `MainDevice("eth0", "eth1")` for a ring between
    two interfaces; `MainDevice("igh:0")` for the IgH kernel master (docs/how_to/igh.md).

        with cat.MainDevice("eth0") as main:
            for sub in main.scan():
                print(sub.position, sub.name, sub.identity, sub.state)

    Leaving the block brings all devices of the last `scan` to INIT, if they can be reached. The IgH
    kernel master leaves its devices in PRE-OP.

    Args:
        target: Name of a segment, or a link source.
        second: Name or link source of the second interface of a ring; None without a ring.
        force: Open an interface even if another master is live on it (docs/how_to/networks.md).
            It has no effect on the kernel master.
    """

    def __init__(
        self,
        target: str | LinkSource,
        second: str | LinkSource | None = None,
        *,
        force: bool = False,
    ) -> None:
        source = source_of(target)
        super().__init__(source if second is None else _ring(source, second), force=force)


def _ring(first: LinkSource, second: str | LinkSource) -> Ring:
    """Return the ring between two link sources.

    Raises:
        ConfigurationError: A source is a whole virtual segment instead of one of its ends.
    """
    ring = Ring(first, source_of(second))
    if any(hasattr(end, "open_end") for end in (ring.first, ring.second)):
        raise ConfigurationError(
            "a whole virtual segment cannot be one end of a ring",
            hint="create Segment([...], ring=True), and open MainDevice(segment.first, "
            "segment.second)",
        )
    return ring


def source_of(target: str | LinkSource) -> LinkSource:
    """Return the link source of a name, or the source itself.

    Raises:
        ConfigurationError: The name is invalid.
        TypeError: The target is neither a name nor a link source.
    """
    if isinstance(target, str):
        return parse(target)
    if isinstance(target, type) or not hasattr(target, "open_link"):
        raise TypeError(f'{target!r} is not a target: pass a name such as "eth0", or a Segment')
    return target
