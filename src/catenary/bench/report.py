"""Report of `catenary bench loop`: text and JSON."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from catenary.bench import verdict
from catenary.bench.setting import Setting
from catenary.bench.statistics import Run

HEADLINES = {
    "output_delay": "output delay",
    "wake_to_sent": "wake to sent",
    "input_age": "input age",
}
COLUMNS = ("period", "lateness", "receive", "process", "send", "in_controller", "post_processing")
FIGURES = ("max", "p50", "p99")  # in the order of catenary.figures
NAME, FIGURE, GAP = 20, 9, "   "  # width of a name, width of a figure, and separator of groups
PHASE = 17  # width of a phase


def machine() -> str:
    """Return a description of the processor, the CPUs, the kernel and the interpreter."""
    return (
        f"{processor()}, {os.cpu_count()} CPUs, {platform.system()} {platform.release()} "
        f"{preemption()}, {platform.python_implementation()} {platform.python_version()}"
    )


def processor() -> str:
    for line in _lines(Path("/proc/cpuinfo")):
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def preemption() -> str:
    words = [word for word in platform.version().split() if "PREEMPT" in word]
    return words[0] if words else "no PREEMPT"


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []


def as_json(
    runs: Sequence[Run], ratios: Mapping[str, float], setting: Mapping[str, object]
) -> dict[str, object]:
    return {
        "machine": machine(),
        **setting,
        "runs": [
            {
                "name": run.name,
                "cycles": run.cycles,
                "uncommitted": run.uncommitted,
                "lost": run.lost,
                "cpu_us_per_cycle": round(run.cpu_us_per_cycle, 3),
                **({"answers": run.answers} if run.answers else {}),
                "scheduling": run.scheduling,
                "timing_us": run.timing_us,
                "rounds": asdict(run.rounds),
            }
            for run in runs
        ],
        "ratios": dict(ratios),
    }


def loop_text(
    machine: str, setting: Setting, runs: Sequence[Run], ratios: Mapping[str, float]
) -> str:
    """Return the machine, the setting, all tables and the verdicts as text."""
    blocks = [f"{machine}\n{setting}", as_text(runs, ratios), verdict.as_text(runs, setting.rate)]
    return "\n\n".join(blocks)


def as_text(runs: Sequence[Run], ratios: Mapping[str, float]) -> str:
    """Return the headline figures, the phases, the counters and the ratios as tables."""
    blocks = [_headlines(runs), *(_phases(runs, figure) for figure in FIGURES), _counters(runs)]
    return "\n\n".join([*blocks, *([_ratios(ratios)] if ratios else [])])


def _headlines(runs: Sequence[Run]) -> str:
    """Return a table of the main figures: output delay, input age and CPU time."""
    wide = FIGURE * len(FIGURES)
    groups = GAP.join(f"{title:>{wide}}" for title in HEADLINES.values())
    figures = GAP.join("".join(f"{name:>{FIGURE}}" for name in FIGURES) for _ in HEADLINES)
    lines = [
        f"{'':{NAME}}{groups}{GAP}{'CPU':>{FIGURE}}",
        f"{'[us]':{NAME}}{figures}{GAP}{'per cycle':>{FIGURE}}",
    ]
    for run in runs:
        texts = GAP.join(
            "".join(f"{run.timing_us[column][name]:{FIGURE}.2f}" for name in FIGURES)
            for column in HEADLINES
        )
        lines.append(f"{run.name:{NAME}}{texts}{GAP}{run.cpu_us_per_cycle:{FIGURE}.2f}")
    return "\n".join(lines)


def _phases(runs: Sequence[Run], figure: str) -> str:
    title = {"p50": "phases, median [us]"}.get(figure, f"phases, {figure} [us]")
    lines = [f"{title:{NAME}}" + "".join(f"{name:>{PHASE}}" for name in COLUMNS)]
    lines += [
        f"{run.name:{NAME}}"
        + "".join(f"{run.timing_us[name][figure]:{PHASE}.2f}" for name in COLUMNS)
        for run in runs
    ]
    return "\n".join(lines)


def _counters(runs: Sequence[Run]) -> str:
    lines = [f"{'':{NAME}}{'rounds':>8}{'cycles':>9}{'uncommitted':>13}{'lost':>7}"]
    lines += [
        f"{run.name:{NAME}}{len(run.rounds.cycles):8d}{run.cycles:9d}{run.uncommitted:13d}{run.lost:7d}"
        for run in runs
    ]
    return "\n".join(lines)


def _ratios(ratios: Mapping[str, float]) -> str:
    """Return a table of ratios, with a row for each pair of peers and a column for each phase.

    The keys of `ratios` are "phase: a / b".
    """
    keys = [key.split(": ", 1) for key in ratios]
    phases = list(dict.fromkeys(phase for phase, _ in keys))
    pairs = list(dict.fromkeys(pair for _, pair in keys))
    widths = [max(len(phase), 7) + 2 for phase in phases]
    name = max(map(len, pairs), default=0) + 2
    lines = [
        f"{'ratios':{name}}"
        + "".join(f"{phase:>{width}}" for phase, width in zip(phases, widths, strict=True))
    ]
    for pair in pairs:
        values = [ratios.get(f"{phase}: {pair}") for phase in phases]
        lines.append(
            f"{pair:{name}}"
            + "".join(
                f"{'-' if value is None else f'{value:.2f}':>{width}}"
                for value, width in zip(values, widths, strict=True)
            )
        )
    return "\n".join(lines)
