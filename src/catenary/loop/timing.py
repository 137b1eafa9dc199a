"""The figures of a loop: the phases of its cycles, as numbers and as a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

FIGURES = ("mean", "max", "min", "sd", "p50", "p99", "p999")


class Timing(Mapping[str, Mapping[str, float]]):
    """Per phase of the cycle, mean, max, min, sd and quantiles in us.

    period: from instant to instant as it was met; lateness: of the wake-up against its instant;
    receive: wake-up → inputs usable; process: the body (of a law also ahead of its instant); send:
    its end → the last frame is out; in_controller: the three together; tail: what remains before
    the next wait; round_trip: of the last frame. Phases that did not occur are left out.
    """

    def __init__(
        self, phases: Mapping[str, Mapping[str, float]], counters: Mapping[str, int]
    ) -> None:
        self._phases = {name: figures for name, figures in phases.items() if figures["count"]}
        self.counters = dict(counters)  # cycles, lost, late, ... as counted by the engine

    def __getitem__(self, phase: str) -> Mapping[str, float]:
        return self._phases[phase]

    def __iter__(self) -> Iterator[str]:
        return iter(self._phases)

    def __len__(self) -> int:
        return len(self._phases)

    def __str__(self) -> str:
        rows = [f"{'[us]':<14}" + "".join(f"{name:>11}" for name in FIGURES)]
        for phase, figures in self._phases.items():
            rows.append(f"{phase:<14}" + "".join(f"{figures[name]:>11.2f}" for name in FIGURES))
        counted = ", ".join(f"{self.counters[name]} {name}" for name in ("cycles", "lost", "late"))
        return "\n".join([*rows, counted])
