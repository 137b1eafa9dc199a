"""`python -m benchmarks table`: published tables next to our figures. Each table has a module with
`measure(options) -> Sheet`.

`catenary.bench.enter_private_network` may run the program anew before NumPy is imported, so nothing
is imported here before it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from benchmarks.tables.sheet import Options, Sheet


class Table(NamedTuple):
    help: str  # one line
    wires: bool  # it wants frames on wires, so a private network


TABLES = {
    "pyigh": Table("one loop, three drives, 1 kHz: Python beside C, and whether they differ", True),
    "tocabi": Table("18 + 15 axes on two networks, 4 and 8 kHz: latency, send, receive", True),
    "cobot": Table("six tasks of a six-axis cobot, by the program of examples/cobot", False),
    "tasks": Table("three spinning tasks: C, Python as processes and threads; the analysis", False),
    "rteml": Table("intervals of cyclic frames in a capture at 5 kHz", True),
    "skew": Table("two digital outputs at both ends of the line, with and without SYNC0", False),
    "interrupt": Table("reaction of a waiting task to an event: eventfd, signal, timer", False),
}


def measure(name: str, options: Options) -> Sheet:
    """ValueError: no such table; it lists those there are."""
    check(name)
    sheet: Sheet = import_module(f"{__name__}.{name}").measure(options)
    return sheet


def check(name: str) -> None:
    if name not in TABLES:
        raise ValueError(f"there is no table {name!r}; there are {', '.join(TABLES)}")
