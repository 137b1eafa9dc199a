"""Names of segments: "eth0", "eth0,eth1" (a ring), "virtual", "virtual:FILE.toml", "igh:0".

"virtual-realtime[:FILE.toml]" is a virtual segment on this machine's clock. "machine.toml" is a
machine file, which names one of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from catenary.errors import ConfigurationError
from catenary.link import Interface, LinkSource, Ring
from catenary.target.toml_file import is_machine_file, read_toml, target_of

if TYPE_CHECKING:
    from catenary.virtual import Segment

VIRTUAL = "virtual"
VIRTUAL_REALTIME = "virtual-realtime"
IGH = "igh"
SHARE = "share"


def parse(target: str) -> LinkSource:
    """Return the link source of a name, without opening it.

    Each call creates a new virtual segment.

    Raises:
        ConfigurationError: The name is invalid.
    """
    target = named_target(target)
    kind, colon, rest = target.partition(":")
    if target.lower().endswith(".xml") and not colon:
        raise ConfigurationError(
            f"{target!r} is an XML file, not a segment",
            hint='run an ENI with cat.Machine("bus.xml", target="eth0"), or convert it: '
            "catenary init bus.xml",
        )
    if kind in (VIRTUAL, VIRTUAL_REALTIME) and (rest or not colon):
        return _virtual(rest, realtime=kind == VIRTUAL_REALTIME)
    if "," in target:
        return _ring(target)
    if kind == SHARE:
        raise ConfigurationError(
            f"{target!r} is a running program, not a segment",
            hint="these commands accept a share: scan, state, diag, messages, sdo, reg read and "
            "shell; in Python, use cat.connect",
        )
    if kind == IGH:
        return _kernel_master(target, rest)
    if not kind or colon or any(letter.isspace() or letter == "/" for letter in kind):
        raise ConfigurationError(
            f"invalid target {target!r}",
            hint="use a network interface (eth0), two (eth0,eth1), virtual, virtual:FILE.toml, "
            "virtual-realtime, igh:0, or a machine file (machine.toml)",
        )
    return Interface(kind)


def _kernel_master(target: str, rest: str) -> LinkSource:
    from catenary.igh import Master

    if not rest.isdecimal():
        raise ConfigurationError(
            f"invalid target {target!r}: the number of the IgH master is missing", hint="use igh:0"
        )
    return Master(int(rest))


def _ring(target: str) -> LinkSource:
    names = target.split(",")
    if len(names) != 2 or names[0].strip() == names[1].strip():
        raise ConfigurationError(
            f"{target!r} is not a ring", hint="use two different network interfaces: eth0,eth1"
        )
    first, second = (parse(name) for name in names)
    if not isinstance(first, Interface) or not isinstance(second, Interface):
        raise ConfigurationError(
            f"{target!r}: a ring needs two network interfaces",
            hint="create a virtual ring in Python: MainDevice(segment.first, segment.second)",
        )
    return Ring(first, second)


def in_virtual_time(target: str) -> bool:
    """Return True if the target is a virtual segment in virtual time."""
    return named_target(target).partition(":")[0] == VIRTUAL


def named_target(target: str) -> str:
    """Return the target that a machine file names, or the target itself.

    Raises:
        MachineFileError: The machine file cannot be read, or names no target.
    """
    name = target.strip()
    return target_of(read_toml(name)).strip() if is_machine_file(name) else name


def _virtual(path: str, *, realtime: bool) -> LinkSource:
    from catenary.virtual import demo_segment, read_segment  # not needed for a NIC

    clock: Literal["virtual", "monotonic"] = "monotonic" if realtime else "virtual"
    segment = read_segment(path, clock=clock) if path else demo_segment(clock=clock)
    return Ring(segment.first, segment.second) if segment.ring else segment


def segment_of(source: LinkSource) -> Segment | None:
    """Return the virtual segment that a source opens; None if it is not virtual."""
    from catenary.virtual.segment import Segment, SegmentEnd

    end = source.first if isinstance(source, Ring) else source
    if isinstance(end, SegmentEnd):
        return end.segment
    return end if isinstance(end, Segment) else None
