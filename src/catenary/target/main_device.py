"""The public MainDevice: takes the name of a segment, or a link source."""

from __future__ import annotations

from typing import Self

from catenary import bus
from catenary.link import LinkSource, Ring
from catenary.target.parse import IGH, parse
from catenary.target.toml_file import is_machine_file


class MainDevice(bus.MainDevice):
    """Owns the link to one segment: `MainDevice("eth0")`, `MainDevice("virtual")`,
    `MainDevice(Segment([...]))`; `MainDevice("eth0", "eth1")` where the segment is a ring between
    two ports; `MainDevice("igh:0")` on the IgH kernel master (docs/igh.md).

        with cat.MainDevice("eth0") as main:
            for sub in main.scan():
                print(sub.position, sub.name, sub.identity, sub.state)

    Leaving the block brings all devices to INIT, whatever happened in it.

    Opening is refused while another master is live on the interface (docs/networks.md).
    `force=True` opens it anyway; on the kernel master it has no effect.
    """

    def __new__(
        cls,
        target: str | LinkSource,
        second: str | LinkSource | None = None,
        *,
        force: bool = False,
    ) -> Self:
        """A source may bring a MainDevice of its own: the IgH kernel master does."""
        named = isinstance(target, str) and (
            target.strip().startswith(f"{IGH}:") or is_machine_file(target)
        )
        make = getattr(source_of(target) if named else target, "main_device", None)
        if make is not None:
            own: Self = make()
            return own
        return super().__new__(cls)

    def __init__(
        self,
        target: str | LinkSource,
        second: str | LinkSource | None = None,
        *,
        force: bool = False,
    ) -> None:
        source = source_of(target)
        super().__init__(source if second is None else Ring(source, source_of(second)), force=force)


def source_of(target: str | LinkSource) -> LinkSource:
    """A name's link source, or the source itself."""
    return parse(target) if isinstance(target, str) else target
