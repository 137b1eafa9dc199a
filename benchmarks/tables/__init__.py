"""`python -m benchmarks table`: published tables next to our figures.

Each table has a module with `measure(options) -> Sheet`. Imports are inside the functions, because
`catenary.bench.enter_private_network` may restart the program, before NumPy is imported.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from benchmarks.tables.sheet import Options, Sheet


class Table(NamedTuple):
    help: str  # one line
    wires: bool  # True if it needs network interfaces, and so a private network


TABLES = {
    "pyigh": Table("one loop, three drives, 1 kHz: Python compared with C", True),
    "tocabi": Table("18 + 15 axes on two networks, 4 and 8 kHz: latency, send, receive", True),
    "humanoid_tasks": Table("a humanoid's two networks and stand-ins of its tasks", True),
    "cobot": Table("six tasks of a six-axis cobot, with the program of examples/cobot", False),
    "tasks": Table("three busy tasks: C, Python processes, Python threads, and analysis", False),
    "rteml": Table("intervals of cyclic frames in a capture at 5 kHz", True),
    "rdda": Table("a gripper with two drives at 2 kHz, idle and loaded; its experiments", True),
    "skew": Table("two digital outputs at both ends of the line, with and without SYNC0", False),
    "interrupt": Table("reaction of a waiting task to an event: eventfd, signal, timer", False),
}


def measure(name: str, options: Options) -> Sheet:
    """Measure a table.

    Args:
        name: Name of the table.
        options: Options of the command line.

    Raises:
        ValueError: The table does not exist.
    """
    check(name)
    sheet: Sheet = import_module(f"{__name__}.{name}").measure(options)
    return sheet


def check(name: str) -> None:
    if name not in TABLES:
        raise ValueError(f"unknown table {name!r}; known tables: {', '.join(TABLES)}")
