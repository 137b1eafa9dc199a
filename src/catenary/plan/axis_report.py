"""Facts about an axis for the printed plan. The core does not need them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AxisReport:
    """Modes of an axis, and the lines that `print(plan)` shows below its name."""

    name: str
    modes: tuple[int, ...] = ()  # modes of operation 0x6060 that the application may use
    lines: tuple[str, ...] = ()
