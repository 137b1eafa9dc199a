"""Setting: the parameters of `catenary bench loop`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Setting:
    drives: int = 3
    rate: int = 1000  # [Hz]
    seconds: float = 10.0  # per peer
    body: str = "sine"  # or "pd"
    spin: bool = False  # True to run a busy Python thread next to every loop
    rounds: int | None = None  # per peer; None for rounds of less than a second
    busy_wait: float = 0.0  # [s] before each cycle start, in Catenary's loops and `c-busy`

    def __str__(self) -> str:
        notes = [f"{self.drives} drives at {self.rate} Hz, body {self.body}"]
        notes += ["spinning"] if self.spin else []
        notes += [f"busy-wait {self.busy_wait * 1e6:g} us"] if self.busy_wait else []
        return ", ".join(notes)
