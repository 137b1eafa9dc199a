"""The figures of a loop: the phases of its cycles, as numbers and as a table."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping

BUSY_SHARE = 0.5  # of the switch interval: a wait this long shows a second busy thread
FIGURES = ("mean", "max", "min", "sd", "p50", "p99", "p999")


class Timing(Mapping[str, Mapping[str, float]]):
    """Mean, max, min, sd and quantiles of each phase of the cycle [us].

    period: wake-up to wake-up. lateness: cycle start → wake-up. receive: wake-up (threaded: last
    frame) → inputs usable. process: the body, or the law. send: wake-up (inline: end of the body) →
    last frame handed to the kernel. in_controller: the sum of these three. tail: post-processing
    until the next wait. round_trip: of the last frame. output_delay: cycle start → last cyclic
    frame handed to the kernel. input_age: frames handed to the kernel → body or law begins with
    their inputs. interpreter: wake-up → this thread has the interpreter. Phases that did not occur
    are left out.
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
        waits = self._phases.get("interpreter", {}).get("p99", 0.0)
        if waits >= BUSY_SHARE * sys.getswitchinterval() * 1e6:
            rows.append(
                f"Another Python thread keeps the interpreter for up to {waits:.0f} us (p99): end "
                "it, run it in a process, or shorten its turns with Loop(switch_interval=20e-6)."
            )
        counted = ", ".join(f"{self.counters[name]} {name}" for name in ("cycles", "lost", "late"))
        return "\n".join([*rows, counted])
