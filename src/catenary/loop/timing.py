"""Timing of a loop: the phases of its cycles as numbers, as a table and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from catenary import notebook
from catenary.figures import FIGURES, heading
from catenary.loop.verdict import counts, verdict

NAME, FIGURE = 14, 11  # widths of a table


class Timing(Mapping[str, Mapping[str, float]]):
    """Count, mean, max, min, sd and quantiles of each phase of the cycle [s].

    `timing["lateness"]["p99"]`; `print(timing)` shows them in microseconds, with `verdict`.

    period: wake-up to wake-up. lateness: cycle start → wake-up. receive: wake-up (threaded: last
    frame) → inputs usable. process: the body, or the law. send: wake-up (inline: end of the body) →
    last frame handed to the kernel. in_controller: the sum of these three. tail: post-processing
    until the next wait. round_trip: of the last frame. output_delay: cycle start → last cyclic
    frame handed to the kernel. input_age: frames handed to the kernel → body or law begins with
    their inputs. interpreter: wake-up → this thread has the interpreter. Phases that did not occur
    are left out.
    """

    def __init__(
        self,
        phases: Mapping[str, Mapping[str, float]],
        counters: Mapping[str, int],
        *,
        period: float,
        scheduling: str,
    ) -> None:
        self._phases = {name: figures for name, figures in phases.items() if figures["count"]}
        self.counters = dict(counters)  # since the loop was entered: cycles, late, lost, ...
        self.period = period  # [s]
        self.scheduling = scheduling  # of the cycle thread; "virtual time"

    def __getitem__(self, phase: str) -> Mapping[str, float]:
        if phase not in self._phases:
            known = ", ".join(self) or "none"
            raise KeyError(f"no phase {phase!r} in these cycles; there are: {known}")
        return self._phases[phase]

    def __iter__(self) -> Iterator[str]:
        return iter(self._phases)

    def __len__(self) -> int:
        return len(self._phases)

    @property
    def is_virtual(self) -> bool:
        """True if the times are of the segment's own clock, not of this machine."""
        return self.scheduling == "virtual time"

    @property
    def verdict(self) -> str:
        """Late, uncommitted, underrun and lost cycles in words, each with the next step. One line
        each."""
        return "\n".join(verdict(self))

    def __str__(self) -> str:
        head = f"{'[us]':<{NAME}}" + "".join(f"{heading(name):>{FIGURE}}" for name in FIGURES)
        rows = [f"{name:<{NAME}}" + "".join(f"{t:>{FIGURE}}" for t in r) for name, *r in self._rows]
        return "\n".join([head, *rows, counts(self.counters), *verdict(self)])

    def _repr_html_(self) -> str:
        table = notebook.table(["[us]", *map(heading, FIGURES)], self._rows)
        return table + notebook.lines([counts(self.counters), *verdict(self)])

    @property
    def _rows(self) -> list[list[str]]:
        """One row of text for each phase [us]."""
        return [
            [phase, *(f"{figures[name] * 1e6:.2f}" for name in FIGURES)]
            for phase, figures in self._phases.items()
        ]
