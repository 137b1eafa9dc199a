"""Results of the humanoid's runs: a table, TOCABI's published table next to ours, and plots."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import body
import numpy as np
from exchange import Verdict

from benchmarks.tables.published import TOCABI, TOCABI_CONDITIONS, Channel, spread_of
from benchmarks.tables.sheet import grid, slashed

if TYPE_CHECKING:
    from run import Outcome

NETWORKS = ("upper", "lower")
TIMES = ("lateness", "send", "receive")
HEADER = ("run", "mode", "result", "sway [mm]", "tilt [deg]", "lost cycles", "times real time")
TIMING_HEADER = ("avg/max/min/sd [us]", "latency", "send", "receive", "overflows", "lost")
LONGEST = 70  # characters of an event in a plot
SHOWN_BEFORE = 0.6  # [s] before the end of the bring-up
SHOWN = ("left_hip_pitch", "left_knee", "left_ankle_pitch", "left_ankle_roll", "right_elbow")


@dataclass(frozen=True)
class Result:
    """Figures of one run."""

    name: str
    mode: str
    stands: bool
    ended_by: str  # decision of the safety task; empty if there was none
    ended_at: float  # [s] after the end of the bring-up; NaN without a decision
    sway: float  # [m] largest horizontal motion of the centre of mass
    tilt: float  # [rad] largest tilt of the pelvis
    cycles: tuple[int, ...]
    lost: tuple[int, ...]
    late: tuple[int, ...]
    speed: float  # of the loop, compared with real time

    @property
    def text(self) -> str:
        if self.stands:
            return "stands"
        return f"{self.ended_by} at {self.ended_at:.2f} s"


def result(outcome: Outcome) -> Result:
    """Return the figures of a run, after its bring-up."""
    rows = outcome.history[outcome.history["time"] >= outcome.began]
    com = rows["com"][:, :2] - rows["com"][0, :2]
    counters = [timing.counters for timing in outcome.timing]
    stands = outcome.verdict == Verdict.GO
    ends = [each for each in outcome.events if each.text.endswith((": damping", ": stop"))]
    return Result(
        name=outcome.setup.scenario.name,
        mode=outcome.setup.scenario.mode,
        stands=stands,
        ended_by="" if stands else outcome.cause.text,
        ended_at=np.nan if stands else ends[0].time - outcome.began,
        sway=float(np.hypot(*com.T).max()),
        tilt=float(rows["tilt"].max()),
        cycles=tuple(each["cycles"] for each in counters),
        lost=tuple(each["lost"] for each in counters),
        late=tuple(each["late"] for each in counters),
        speed=float(outcome.history["time"][-1] / outcome.seconds),
    )


def as_table(results: Sequence[Result]) -> str:
    rows = [
        (
            each.name,
            each.mode,
            each.text,
            f"{each.sway * 1e3:.1f}",
            f"{np.degrees(each.tilt):.1f}",
            " + ".join(map(str, each.lost)),
            f"{each.speed:.2f}",
        )
        for each in results
    ]
    return grid(HEADER, rows)


def as_timing(outcomes: Sequence[Outcome]) -> str:
    """Return TOCABI's published table at 4 kHz, with ours below it."""
    rows = [
        (f"theirs: {name}", *timing_cells(channel), "-")
        for (rate, name), channel in TOCABI.items()
        if rate == 4000
    ]
    is_virtual = outcomes[0].setup.virtual
    for number, name in enumerate(NETWORKS):
        counters = [each.timing[number].counters for each in outcomes]
        late, lost, cycles = (
            sum(each[key] for each in counters) for key in ("late", "lost", "cycles")
        )
        times = ("-",) * 3 if is_virtual else times_of(outcomes, number)
        rows.append((f"ours: {name}", *times, str(late), f"{lost} of {cycles}"))
    lines = [TOCABI_CONDITIONS, grid(TIMING_HEADER, rows)]
    if is_virtual:
        lines.append(
            "In virtual time, only the counts are comparable: the network and the processor take\n"
            "no time of their own. `make humanoid HUMANOID=--realtime` measures times."
        )
    return "\n".join(lines)


def timing_cells(channel: Channel) -> tuple[str, ...]:
    spreads = (channel.latency, channel.send, channel.receive)
    return (*(slashed(each, 2) for each in spreads), channel.overflows)


def times_of(outcomes: Sequence[Outcome], number: int) -> tuple[str, ...]:
    """Return the times of a network in the last run."""
    timing = outcomes[-1].timing[number]
    spreads = [spread_of(timing[name], 1e6) for name in TIMES]
    return tuple(slashed(each, 2) for each in spreads)


def as_tasks(outcome: Outcome) -> str:
    """Return the rate, the computing time and the missed jobs of each task."""
    rows = []
    for handle in outcome.tasks:
        jobs, missed = handle.statistics.jobs, handle.statistics.misses
        spent = outcome.computing.get(handle.name)
        rows.append(
            (
                handle.name,
                f"{1 / handle.task.period:.0f}",
                "-" if spent is None else f"{spent * 1e6:.0f}",
                "-" if spent is None else f"{spent / handle.task.period:.0%}",
                f"{missed} of {jobs}",
            )
        )
    header = ("task", "rate [Hz]", "computing [us]", "of a processor", "missed jobs")
    return grid(header, rows)


def report(folder: Path, outcomes: Sequence[Outcome], *, plots: bool = True) -> None:
    """Print the results of all runs. Write `humanoid.json`, and one plot per run."""
    results = [result(each) for each in outcomes]
    print(f"\n{as_table(results)}\n\n{as_timing(outcomes)}\n")
    print(as_tasks(outcomes[-1]))
    found = [
        {**vars_of(one), "events": [(e.time - each.began, e.text) for e in each.events]}
        for one, each in zip(results, outcomes, strict=True)
    ]
    (folder / "humanoid.json").write_text(json.dumps(found, indent=1) + "\n")
    for each in outcomes if plots else ():
        path = folder / f"{each.setup.scenario.name}.png"
        plot(each, path)
        print(f"wrote {path}")


def vars_of(one: Result) -> dict[str, object]:
    return {name: getattr(one, name) for name in Result.__dataclass_fields__}


def plot(outcome: Outcome, path: Path) -> None:
    """Plot joints, centre of mass, tilt, forces and events over the time after the bring-up."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    began = outcome.began
    rows = outcome.history[outcome.history["time"] > began - SHOWN_BEFORE]
    time = rows["time"] - began
    start = np.searchsorted(time, 0.0)
    figure, axes = pyplot.subplots(
        5, 1, figsize=(9, 13), sharex=True, layout="constrained", height_ratios=(1, 1, 1, 1, 2)
    )
    joints, com, tilt, force, events = axes
    for name in SHOWN:
        q = rows["position"][:, body.INDEX[name]]
        joints.plot(time, np.degrees(q - q[start]), label=name.replace("_", " "), lw=1)
    joints.set_ylabel("joints [deg]")
    for axis, name in enumerate("xy"):
        moved = (rows["com"][:, axis] - rows["com"][start, axis]) * 1e3
        before = rows["estimate"][:start, axis]
        estimated = (rows["estimate"][:, axis] - before[len(before) // 2 :].mean()) * 1e3
        com.plot(time, moved, label=name, lw=1)
        com.plot(time, estimated, label=f"{name}, estimated", lw=0.7, ls=":")
    com.set_ylabel("centre of mass [mm]")
    tilt.plot(time, np.degrees(rows["tilt"]), lw=1)
    tilt.set_ylabel("tilt [deg]")
    for foot, side in enumerate(body.SIDES):
        force.plot(time, rows["force"][:, foot], label=side, lw=0.7)
    force.set_ylabel("feet [N]")
    mark_events(events, outcome)
    events.set_xlabel("time after the bring-up [s]")
    for each in axes:
        each.grid(alpha=0.3)
        if each.get_legend_handles_labels()[1]:
            each.legend(fontsize=7, loc="upper left", ncols=3)
    figure.suptitle(f"{outcome.setup.scenario.name}: {outcome.setup.scenario.text}")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def mark_events(axes: object, outcome: Outcome) -> None:
    """Draw each event as a line with its text, one below the other."""
    shown = [each for each in outcome.events if each.time > outcome.began - SHOWN_BEFORE]
    for number, event in enumerate(shown):
        at, height = event.time - outcome.began, -number
        axes.axvline(at, color="grey", lw=0.5)
        is_late = at > outcome.history["time"][-1] / 2 - outcome.began
        side = "right" if is_late else "left"
        text = event.text if len(event.text) < LONGEST else event.text[:LONGEST] + " ..."
        shown_text = axes.text(at, height, f" {text} ", fontsize=7, va="center", ha=side)
        shown_text.set_in_layout(False)
    axes.set_ylim(-len(shown), 1)
    axes.set_yticks([])
    axes.set_ylabel("events")
