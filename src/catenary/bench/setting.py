"""Setting: what one run of `catenary bench loop` measures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Setting:
    drives: int = 3
    rate: int = 1000  # [Hz]
    seconds: float = 10.0  # of every peer
    body: str = "sine"  # or "pd"
    spin: bool = False  # a Python thread spins next to every loop
    rounds: int | None = None  # of every peer; None: as many as keep a round below a second
    busy_wait: float = 0.0  # [s] of our loops and of `c-busy` before each cycle start

    def __str__(self) -> str:
        notes = [f"{self.drives} drives at {self.rate} Hz, body {self.body}"]
        notes += ["spinning"] if self.spin else []
        notes += [f"busy-wait {self.busy_wait * 1e6:g} us"] if self.busy_wait else []
        return ", ".join(notes)
