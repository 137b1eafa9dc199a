"""Timing of a loop: the phases of its cycles as numbers, as a table and as advice."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping

from catenary import notebook
from catenary.figures import FIGURES, heading

NAME, FIGURE = 16, 11  # widths of a table
COUNTED = ("late", "uncommitted", "underrun", "lost")
BUSY_SHARE = 0.5  # share of the switch interval; a longer wait indicates a second busy thread
LATE_SHARE = 0.1  # share of the period; a later wake-up is reported
VIRTUAL = "virtual time: the segment's own clock, not this machine's"


class Timing(Mapping[str, Mapping[str, float]]):
    """Count, mean, max, min, sd and quantiles of each phase of the cycle [s].

    `timing["lateness"]["p99"]`; `print(timing)` shows them in microseconds, with `verdict`.

    - period: wake-up → next wake-up.
    - lateness: cycle start → wake-up.
    - receive: wake-up (threaded: last frame) → inputs ready.
    - process: the body, or the law.
    - send: wake-up (inline: end of the body) → last frame passed to the kernel.
    - in_controller: sum of receive, process and send.
    - post_processing: work after the frames, until the next wait.
    - round_trip: frames passed to the kernel → last frame received (threaded).
    - output_delay: cycle start → last cyclic frame passed to the kernel.
    - input_age: frames passed to the kernel → body or law begins with their inputs.
    - interpreter: wake-up → this thread has the interpreter.

    Phases that did not occur are omitted.
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
        self.scheduling = scheduling  # of the cycle thread as text, or "virtual time"

    def __getitem__(self, phase: str) -> Mapping[str, float]:
        if phase not in self._phases:
            known = ", ".join(self) or "none"
            raise KeyError(f"no phase {phase!r} in these cycles; they have: {known}")
        return self._phases[phase]

    def __iter__(self) -> Iterator[str]:
        return iter(self._phases)

    def __len__(self) -> int:
        return len(self._phases)

    @property
    def is_virtual(self) -> bool:
        """True if the times are on the segment's own clock, not this machine's."""
        return self.scheduling == "virtual time"

    @property
    def verdict(self) -> str:
        """Bad cycles and long waits for the interpreter as text, one line per kind, with advice."""
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


def counts(counters: Mapping[str, int]) -> str:
    """Return counters as text: "5000 cycles: 12 late, 0 uncommitted, 0 underrun, 0 lost"."""
    each = ", ".join(f"{counters.get(name, 0)} {name}" for name in COUNTED)
    return f"{counters.get('cycles', 0)} cycles: {each}"


def verdict(timing: Timing) -> Iterator[str]:
    """Yield one line for virtual time, and one for each kind of problem.

    If no cycle was late, uncommitted, underrun or lost, a line states this.
    """
    if timing.is_virtual:
        yield VIRTUAL
    lines = [*_late(timing), *_uncommitted(timing), *_underrun(timing), *_lost(timing)]
    yield from lines
    yield from _interpreter(timing)
    if not lines:
        yield _nothing(timing)


def _late(timing: Timing) -> Iterator[str]:
    """Yield a line about skipped cycle starts, if any."""
    if not timing.counters.get("late"):
        return
    text = f"{_of_all(timing, 'late')} late (skipped), by up to {_most(timing, 'lateness')}"
    if timing.is_virtual:
        yield f"{text}: the body or a task used the virtual time"
    elif _worst(timing, "process") > timing.period:
        yield f"{text}: {_long_body(timing)}"
    elif timing.scheduling.startswith("SCHED_OTHER"):
        yield f"{text}: the cycle has no real-time priority; see `catenary doctor`"
    else:
        yield f"{text}: another process or an interrupt uses this CPU; see `catenary doctor`"


def _uncommitted(timing: Timing) -> Iterator[str]:
    """Yield a line about cycles that repeated the targets of the previous one, if any."""
    if not timing.counters.get("uncommitted"):
        return
    text = f"{_of_all(timing, 'uncommitted')} uncommitted: the program wrote no new targets in time"
    if _worst(timing, "process") > timing.period:
        yield f"{text}; {_long_body(timing)}"
    else:
        yield (
            f"{text}; check for waits between two iterations, and for other processes "
            "(`catenary doctor`); loop.stream() can buffer set-points"
        )


def _underrun(timing: Timing) -> Iterator[str]:
    """Yield a line about cycles with an empty stream, if any."""
    if timing.counters.get("underrun"):
        yield (
            f"{_of_all(timing, 'underrun')} underrun: the stream was empty; keep more rows in it, "
            "or close it when the motion is complete"
        )


def _lost(timing: Timing) -> Iterator[str]:
    """Yield a line about cycles without all answers, if any."""
    if timing.counters.get("lost"):
        yield (
            f"{_of_all(timing, 'lost')} lost: frames did not return, or a device did not answer;"
            " `catenary diag TARGET` names the cable or the device"
        )


def _interpreter(timing: Timing) -> Iterator[str]:
    waits = timing.get("interpreter", {}).get("p99", 0.0)
    if waits >= BUSY_SHARE * sys.getswitchinterval():
        yield (
            f"Another Python thread keeps the interpreter for up to {waits * 1e6:.0f} us (p99): "
            "end it, move it to another process, or use Scheduling(switch_interval=20e-6)."
        )


def _nothing(timing: Timing) -> str:
    text = "No cycle was late, uncommitted, underrun or lost."
    worst = _worst(timing, "lateness")
    if timing.is_virtual or worst < LATE_SHARE * timing.period:
        return text
    return (
        f"{text} The latest wake-up was {worst * 1e6:.0f} us after its cycle start: "
        "`catenary doctor` shows possible causes."
    )


def _long_body(timing: Timing) -> str:
    return (
        f"the body took up to {_most(timing, 'process')} of a period of "
        f"{timing.period * 1e6:.0f} us; move slow work into another thread or a law"
    )


def _of_all(timing: Timing, name: str) -> str:
    return f"{timing.counters[name]} of {timing.counters['cycles']} cycles"


def _most(timing: Timing, phase: str) -> str:
    return f"{_worst(timing, phase) * 1e6:.0f} us"


def _worst(timing: Timing, phase: str) -> float:
    return timing.get(phase, {}).get("max", 0.0)
