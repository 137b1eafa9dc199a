"""The master under test: a double of libethercat, or the real one selected by CATENARY_IGH.

CATENARY_IGH=0          the kernel's master 0, with a found library or CATENARY_LIBETHERCAT
CATENARY_IGH_PERIOD=    [s] of its loops, for a slow machine; 2 ms by default
CATENARY_IGH_MOVE=1     drives may be enabled and moved by a tenth of a turn
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import catenary as cat
from catenary.igh import Master
from tests.igh.double import Double
from tests.loop_options import grouped

REAL = os.environ.get("CATENARY_IGH")
PERIOD = 2e-3
PATIENCE = 5000  # cycles


@dataclass(frozen=True)
class Subject:
    """A kernel master, and the options of a loop on it."""

    make: Callable[[], Master]
    period: float
    may_move: bool

    def open(self) -> cat.MainDevice:
        """Return a MainDevice that reserves it in its `with` block."""
        return cat.MainDevice(self.make())

    def loop(self, *requests: object, **options: object) -> cat.Loop:
        """Return a loop that is not stopped by a stalled machine."""
        calm = {"watchdog": max(0.1, 50 * self.period), "late_limit": 0, "lost_limit": 100}
        settings = {"period": self.period, "enable": False, **calm, **options}
        return cat.Loop(*requests, **grouped(settings))  # type: ignore[arg-type]

    def inputs(self, main: cat.MainDevice) -> list[cat.Inputs]:
        """Return all inputs of all devices."""
        return [cat.Inputs(sub) for sub in main.subs if sub.description.inputs]


def real() -> Subject:
    """Return the real master from the environment."""
    assert REAL is not None
    period = float(os.environ.get("CATENARY_IGH_PERIOD", PERIOD))
    move = os.environ.get("CATENARY_IGH_MOVE") == "1"
    return Subject(lambda: Master(int(REAL)), period, move)


def doubled(path: Path) -> Subject:
    """Return two drives of a double, in virtual time."""
    Double(path)
    return Subject(lambda: Master(library=path, virtual_time=True), PERIOD, may_move=True)


def until(loop: cat.Loop, done: Callable[[], bool]) -> None:
    """Run cycles until a condition holds."""
    for _ in range(PATIENCE):
        if done():
            return
        next(loop)
    raise AssertionError(f"not within {PATIENCE} cycles")
