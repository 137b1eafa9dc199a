"""Touch probes of a drive: options, objects and bits.

CiA 402-2 / IEC 61800-7-201, objects 0x60B8 to 0x60BD and 0x60D0 to 0x60D8. The bits of 0x60B8 and
0x60B9 agree with Beckhoff's EL72x1 and AX8000 and with the notes of Botnana on Panasonic's MINAS.
Bits 6, 7, 14 and 15 of 0x60B9 belong to the manufacturer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.bus import SubDevice
from catenary.drive.axis import Axis
from catenary.drive.objects import AxisObject, Unit
from catenary.errors import ConfigurationError, SdoAbort

FUNCTION_COLUMN, STATUS_COLUMN = "touch_probe_function", "touch_probe_status"
FUNCTION = AxisObject(0x60B8, 0, 16, output=True)
STATUS = AxisObject(0x60B9, 0, 16)
POSITIONS, SOURCES, TIMES, COUNTERS = 0x60BA, 0x60D0, 0x60D1, 0x60D5

PROBES = (1, 2)
EDGES = ("rising", "falling")
SOURCE_BITS = {"input": 0x00, "index_pulse": 0x04}
SOURCE_OF_OBJECT = 0x08  # the source is in 0x60D0

# Bits of one probe. Those of probe 2 are higher by 8.
ENABLE, CONTINUOUS = 0x01, 0x02  # 0x60B8
EDGE_BITS = {"rising": 0x10, "falling": 0x20}
ENABLED = 0x01  # 0x60B9
STORED_BITS = {"rising": 0x02, "falling": 0x04}
TOGGLE_BITS = {"rising": 0x40, "falling": 0x80}
OBJECT_MISSING = (0x06020000, 0x06090011)  # SDO abort codes: no object, no subindex


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchProbe:
    """Objects of the touch probes to exchange: `Drives(touch_probe=TouchProbe(probes=(1, 2)))`.

    The drive must have 0x60B8 and 0x60B9. Other objects are omitted if a drive does not have them,
    or if `pdos=` does not contain them.

    Args:
        probes: Numbers of the probes, 1 and 2.
        edges: Edges whose positions are exchanged, "rising" and "falling".
        times: True to exchange the time stamps, 0x60D1 to 0x60D4.
        counters: True to exchange the counters, 0x60D5 to 0x60D8.
        toggles: True if bits 6, 7, 14 and 15 of 0x60B9 toggle with each edge in continuous mode.
            See the manual of the drive: other drives show the level of the input there.

    Raises:
        ValueError: A probe or an edge does not exist.
    """

    probes: Sequence[int] = (1,)
    edges: Sequence[str] = EDGES
    times: bool = True
    counters: bool = True
    toggles: bool = False

    def __post_init__(self) -> None:
        for name, given, known in (("probes", self.probes, PROBES), ("edges", self.edges, EDGES)):
            if isinstance(given, str) or not given or not set(given) <= set(known):
                both = ", ".join(map(repr, known))
                raise ValueError(f"TouchProbe({name}={given!r}): give one or both of {both}")


def touch_probe_option(given: TouchProbe | bool) -> TouchProbe | None:
    """Return the option `touch_probe` of `Drives`; None if it is False.

    Raises:
        TypeError: The option is neither a TouchProbe nor True or False.
    """
    if isinstance(given, bool):
        return TouchProbe() if given else None
    if not isinstance(given, TouchProbe):
        raise TypeError(f"touch_probe={given!r}: give True or TouchProbe(...)")
    return given


def position_column(probe: int, edge: str) -> str:
    """Return the name of the column with the position of an edge."""
    return f"touch_probe_{probe}_{edge}"


def time_column(probe: int, edge: str) -> str:
    """Return the name of the column with the time stamp of an edge."""
    return f"touch_probe_{probe}_{edge}_time"


def counter_column(probe: int, edge: str) -> str:
    """Return the name of the column with the counter of an edge."""
    return f"touch_probe_{probe}_{edge}_counter"


def required_columns(option: TouchProbe | None) -> dict[str, AxisObject]:
    """Return the objects that the process data must contain, by column."""
    return {} if option is None else {FUNCTION_COLUMN: FUNCTION, STATUS_COLUMN: STATUS}


def optional_columns(option: TouchProbe | None) -> dict[str, AxisObject]:
    """Return the objects that the drive may lack, by column."""
    found: dict[str, AxisObject] = {}
    if option is None:
        return found
    for probe in sorted(option.probes):
        for edge in (each for each in EDGES if each in option.edges):
            k = 2 * (probe - 1) + EDGES.index(edge)
            position = AxisObject(POSITIONS + k, 0, 32, True, Unit.POSITION)
            found[position_column(probe, edge)] = position
            if option.times:
                found[time_column(probe, edge)] = AxisObject(TIMES + k, 0, 32)
            if option.counters:
                found[counter_column(probe, edge)] = AxisObject(COUNTERS + k, 0, 16)
    return found


def with_offered(axis: Axis, sub: SubDevice) -> Axis:
    """Read the objects of the touch probes by SDO, and return the axis with those that exist.

    The process data must then contain them, unless the application specified the PDOs.

    Args:
        axis: The axis.
        sub: Its device.

    Raises:
        ConfigurationError: The drive lacks 0x60B8 or 0x60B9.
        SdoAbort: The drive has an object, but refuses to read it.
    """
    for base in (FUNCTION.index, STATUS.index):
        index = axis.index(base)
        abort = _abort_of(sub, index)
        if abort is not None:
            raise ConfigurationError(
                f"{axis.name}: touch_probe= was requested, but the drive has no object "
                f"0x{index:04X} (SDO abort 0x{abort.code:08X})",
                hint="this drive or its firmware has no touch probe: omit touch_probe=; the manual "
                "may name other objects, which columns= can exchange",
            ) from None
    if axis.pdos:
        return axis
    offered = {
        name: each
        for name, each in axis.optional_columns.items()
        if _abort_of(sub, axis.index(each.index)) is None
    }
    return replace(axis, columns={**axis.columns, **offered})


def _abort_of(sub: SubDevice, index: int) -> SdoAbort | None:
    """Return the abort if an object does not exist; None if it does."""
    try:
        sub.sdo.read(index, 0)
    except SdoAbort as abort:
        if abort.code not in OBJECT_MISSING:
            raise
        return abort
    return None
