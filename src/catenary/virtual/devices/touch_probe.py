"""Touch probes of a virtual drive: options, objects and differences of real drives.

The behaviour is compiled (`servo_probe.h`). In TOML: `touch_probe = { times = true }`.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from catenary.virtual import _segment
from catenary.virtual.coe.dictionary import (
    ARRAY,
    INTEGER16,
    INTEGER32,
    UNSIGNED16,
    UNSIGNED32,
    Dictionary,
    Entry,
)
from catenary.virtual.devices.servo_objects import RW, RX, TX, AxisObject

FUNCTION, STATUS = 0x60B8, 0x60B9
POSITIONS, SOURCES, TIMES, COUNTERS = 0x60BA, 0x60D0, 0x60D1, 0x60D5
EDGES = ("1 positive", "1 negative", "2 positive", "2 negative")


class ProbeOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Touch probes of a drive: its objects, and its differences from CiA 402-2."""

    # Time stamps 0x60D1 to 0x60D4: the low 32 bits of the system time [ns].
    times: bool = True

    # Counters of edges, 0x60D5 to 0x60D8.
    counters: bool = True

    # Bits 6, 7, 14 and 15 of 0x60B9 toggle with each edge in continuous mode. CiA 402-2 leaves
    # these bits to the manufacturer.
    toggles: bool = False

    # True: the bits of the stored edges stay set while a probe is disabled, and are cleared when it
    # is enabled again. CiA 402-2 clears them when the probe is disabled.
    keeps_stored: bool = False

    # True: a probe with both edges is not enabled, as in Panasonic's MINAS
    # (notes of a Botnana master on touch probes: "not both edges at a time").
    one_edge: bool = False


CONTROL = (
    AxisObject(FUNCTION, "Touch probe function", UNSIGNED16, RX, _segment.SLOT_PROBE_FUNCTION),
    AxisObject(STATUS, "Touch probe status", UNSIGNED16, TX, _segment.SLOT_PROBE_STATUS),
)


def _of_edges(first: int, name: str, data_type: int, slot: int) -> tuple[AxisObject, ...]:
    return tuple(
        AxisObject(first + k, f"Touch probe {edge} edge{name}", data_type, TX, slot + k)
        for k, edge in enumerate(EDGES)
    )


EDGE_POSITIONS = _of_edges(POSITIONS, "", INTEGER32, _segment.SLOT_PROBE_POSITIONS)
EDGE_TIMES = _of_edges(TIMES, " time stamp", UNSIGNED32, _segment.SLOT_PROBE_TIMES)
EDGE_COUNTERS = _of_edges(COUNTERS, " counter", UNSIGNED16, _segment.SLOT_PROBE_COUNTERS)


def add_touch_probes(
    options: ProbeOptions,
    dictionary: Dictionary,
    base: int,
    variable: Callable[[AxisObject], Entry],
    slot: Callable[[str, int, int, int], Entry],
) -> None:
    """Add the objects of the touch probes of an axis.

    Args:
        options: Objects that the drive has.
        dictionary: Object dictionary of the device.
        base: Offset of the objects of the axis.
        variable: Returns the entry of an object.
        slot: Returns an entry from its name, data type, slot and access.
    """
    objects = CONTROL + EDGE_POSITIONS
    objects += EDGE_TIMES * options.times + EDGE_COUNTERS * options.counters
    for each in objects:
        dictionary.add_variable(each.index + base, variable(each))
    sources = [
        slot(f"Touch probe {n + 1} source", INTEGER16, _segment.SLOT_PROBE_SOURCE_1 + n, RW)
        for n in range(2)
    ]
    dictionary.add_record(SOURCES + base, "Touch probe source", sources, code=ARRAY)
