"""One cycle in each execution mode, to scale, from the medians of benchmarks/results."""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import Patch

RESULT = (
    Path(__file__).resolve().parents[2] / "benchmarks/results/amd-epyc/2026-11-22/acceptance-3.json"
)
MODES = {
    "catenary-inline": "inline",
    "catenary-threaded": "threaded",
    "catenary-law": "threaded,\nlaw",
}
COLOURS = {  # see _extensions/drawings.py
    "wake-up": "#aaaaaa",
    "send": "#aa0000",
    "round trip": "#eeeeee",
    "receive, body or law": "#0000aa",
}
END = 205  # [us] of the axis; the rest of the period is idle
HEIGHT = 0.4


def phases(mode: str, us: dict[str, float]) -> list[tuple[str, float]]:
    """Return the phases of a cycle and their lengths [us], from its cycle start."""
    if mode == "catenary-inline":
        return [
            ("wake-up", us["lateness"]),
            ("receive, body or law", us["receive"] + us["process"]),
            ("send", us["send"]),
        ]
    return [
        ("wake-up", us["lateness"]),
        ("send", us["output_delay"] - us["lateness"]),
        ("round trip", us["input_age"]),
        ("receive, body or law", us["process"]),
    ]


def draw() -> Figure:
    """Return the figure."""
    runs = {run["name"]: run for run in json.loads(RESULT.read_text())["runs"]}
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    axes = figure.add_subplot()
    for row, mode in enumerate(MODES):
        us = {key: value["p50"] for key, value in runs[mode]["timing_us"].items()}
        time = 0.0
        for name, length in phases(mode, us):
            axes.barh(row, length, HEIGHT, time, color=COLOURS[name])
            time += length
        axes.plot((time, END), (row, row), color="#aaaaaa", linestyle=":")
        sent = us["output_delay"]
        axes.text(sent, row - 0.27, f"sent at {sent:.0f} µs", ha="center", va="bottom")
        age = f"inputs {us['input_age']:.0f} µs old"
        axes.text(max(time, sent + 22), row - 0.27, age, ha="left", va="bottom")
    axes.set_yticks(range(len(MODES)), MODES.values())
    axes.set_xlim(0, END)
    axes.set_ylim(len(MODES) - 0.5, -0.65)
    axes.set_xlabel("time since the cycle start [µs]; the period is 1000 µs")
    axes.spines[["top", "right"]].set_visible(False)
    legend = [Patch(color=colour, label=name) for name, colour in COLOURS.items()]
    figure.legend(handles=legend, loc="outside upper center", ncols=4, frameon=False)
    return figure
