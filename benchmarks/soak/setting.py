"""Settings of a soak test: wiring, clocks and mode of operation, one setting per minute."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal, NamedTuple

Wiring = Literal["line", "ring"]
Mode = Literal["csp", "csv", "cst"]

WIRINGS: tuple[Wiring, ...] = ("line", "ring")
CLOCKS = (False, True)
MODES: tuple[Mode, ...] = ("csp", "csv", "cst")


class Setting(NamedTuple):
    """Wiring of the segment, distributed clocks of the drives, and their mode of operation."""

    wiring: Wiring = "line"
    clocks: bool = False
    mode: Mode = "csp"

    @property
    def is_ring(self) -> bool:
        """True if the last device leads back to the MainDevice."""
        return self.wiring == "ring"

    @property
    def options(self) -> str:
        """Options of the command that select this setting only."""
        clocks = "--clocks" if self.clocks else "--no-clocks"
        return f"--wiring {self.wiring} {clocks} --mode {self.mode}"

    def __str__(self) -> str:
        return f"{self.wiring}, {'clocks' if self.clocks else 'no clocks'}, {self.mode.upper()}"


def settings(
    wirings: Sequence[Wiring] = WIRINGS,
    clocks: Sequence[bool] = CLOCKS,
    modes: Sequence[Mode] = MODES,
) -> tuple[Setting, ...]:
    """Return all combinations; the wiring alternates fastest, then the clocks."""
    return tuple(
        Setting(wiring, clock, mode) for mode, clock, wiring in product(modes, clocks, wirings)
    )


def setting_of(seed: int, choices: Sequence[Setting]) -> Setting:
    """Return the setting of the minute with this seed."""
    return choices[seed % len(choices)]
