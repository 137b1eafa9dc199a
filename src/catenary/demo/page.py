"""demo.html: one self-contained page for light and dark mode, without external files."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import accumulate
from pathlib import Path

import numpy as np

from catenary.demo.plot import Bucket, Line, histogram, line_plot
from catenary.demo.result import PHASES, Device, Result
from catenary.demo.text import longer
from catenary.figures import FIGURES, heading
from catenary.loop.timing import COUNTED

STYLE = Path(__file__).with_name("page.css")
STYLES = ("a", "b", "c")
SHOWN_SECONDS = 4.0  # drawn time at the end of the motion
SHOWN_POINTS = 400  # points per line
HEADINGS = {
    "in_controller": "in controller",
    "post_processing": "post-processing",
    "round_trip": "round trip",
}
MEANING = {
    "period": "wake-up → next wake-up",
    "lateness": "cycle start → wake-up",
    "receive": "wake-up → inputs usable",
    "process": "the Python body of the loop",
    "send": "end of the body → frame sent",
    "in_controller": "receive + process + send",
    "post_processing": "frame sent → start of the next wait",
    "round_trip": "frame sent → frame received",
}


def as_html(result: Result) -> str:
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Catenary demo</title>
<style>
{STYLE.read_text()}</style>
</head>
<body>
<h1>{len(drives(result))} drives on a sine, from Python</h1>
<p class="soft">{escape(summary(result))}</p>
{tiles(result)}
<h2>Motion</h2>
{motion(result)}
<h2>Timing</h2>
{timing_table(result)}
<p class="note">Microseconds. {escape(ground(result))}</p>
<p>{"<br>".join(map(escape, result.timing.verdict.splitlines()))}</p>
<h2>Distributions</h2>
<div class="four">
{"".join(phase_figure(result, phase) for phase in MEANING if result.histograms.get(phase))}
</div>
<h2>Devices</h2>
{device_table(result.devices)}
<p class="note">Made by Catenary. EtherCAT® is a registered trademark and patented technology,
licensed by Beckhoff Automation GmbH, Germany.</p>
</body>
</html>
"""


def drives(result: Result) -> range:
    return range(result.motion.reference.shape[1])


def summary(result: Result) -> str:
    where = (
        "with real EtherCAT frames on a pair of virtual network interfaces"
        if result.link == "veth"
        else "with the virtual segment in the same process"
    )
    return (
        f"{thousands(result.cycles)} cycles at {1.0 / result.period:.0f} Hz {where}; "
        f"{len(result.devices)} devices on the line."
    )


def ground(result: Result) -> str:
    return f"Scheduling: {result.scheduling}. Link: {result.link}."


def tiles(result: Result) -> str:
    timing, error, counters = result.timing_us, result.tracking_error, result.timing.counters
    cells = [
        tile(thousands(result.cycles), "", "cycles"),
        *(
            tile(thousands(counters[name]), "", f"{name} cycles", good=counters[name] == 0)
            for name in COUNTED
        ),
        tile(f"{timing['in_controller']['p50']:.1f}", "µs", "in controller, median"),
        tile(f"{timing['lateness']['p99']:.1f}", "µs", "lateness, p99"),
        tile(f"{error['rms'] * 1e3:.2f}", "mrad", "tracking error, rms"),
    ]
    return f'<div class="tiles">{"".join(cells)}</div>'


def tile(value: str, unit: str, name: str, *, good: bool | None = None) -> str:
    style = {True: ' class="good"', False: ' class="bad"', None: ""}[good]
    return f'<div class="tile"><b{style}>{value} <small>{unit}</small></b><span>{name}</span></div>'


def motion(result: Result) -> str:
    time = result.motion.time
    if len(time) < 2:
        return '<p class="note">The run was too short for a plot.</p>'
    first = int((time >= time[-1] - SHOWN_SECONDS).argmax())
    every = max((len(time) - first) // SHOWN_POINTS, 1)
    part = slice(first, None, every)
    seconds = time[part].tolist()
    reference, actual = result.motion.reference[part], result.motion.actual[part]
    error = np.nan_to_num(result.error[part]) * 1e3  # 0 until the first set-point arrives
    positions = [
        Line(f"reference {n + 1}", "reference", seconds, reference[:, n].tolist())
        for n in drives(result)
    ] + [
        Line(f"drive {n + 1}", STYLES[n % 3], seconds, actual[:, n].tolist())
        for n in drives(result)
    ]
    errors = [
        Line(f"drive {n + 1}", STYLES[n % 3], seconds, error[:, n].tolist()) for n in drives(result)
    ]
    position_plot = line_plot(positions, x_unit="s", y_unit="rad", title="Position over time")
    error_plot = line_plot(errors, x_unit="s", y_unit="mrad", title="Tracking error over time")
    return (
        f'<figure class="wide">{position_plot}<figcaption><b>Position</b> in the last seconds.'
        f"{key(result, reference=True)}</figcaption></figure>"
        f"<figure>{error_plot}<figcaption><b>Tracking error</b>: actual position minus the "
        f"set-point that had reached the drive. The transport delay is "
        f"{result.transport_delay * 1e3:g} ms: from writing a set-point to reading the first "
        f"position that it affects{longer(result)}. {key(result)}</figcaption></figure>"
    )


def key(result: Result, *, reference: bool = False) -> str:
    entries = ['<span class="key reference"></span>reference'] if reference else []
    entries += [f'<span class="key {STYLES[n % 3]}"></span>drive {n + 1}' for n in drives(result)]
    return "".join(entries)


def timing_table(result: Result) -> str:
    head = "".join(f"<th>{heading(name)}</th>" for name in FIGURES)
    figures = result.timing_us
    rows = "".join(
        f'<tr><th title="{escape(MEANING[phase])}">{HEADINGS.get(phase, phase)}</th>'
        + "".join(f"<td>{figures[phase][name]:.1f}</td>" for name in FIGURES)
        + "</tr>"
        for phase in PHASES
    )
    return (
        f'<div class="table"><table><thead><tr><th></th>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )


def phase_figure(result: Result, phase: str) -> str:
    buckets = [(a * 1e6, b * 1e6, count) for a, b, count in result.histograms[phase]]
    low, high = drawn_range(buckets)
    outside = sum(count for lower, upper, count in buckets if lower >= high or upper <= low)
    most = max(upper for _, upper, _ in buckets)
    rest = f" Outside: {outside}, up to {most:.0f} µs." if outside else ""
    name = HEADINGS.get(phase, phase)
    drawn = histogram(buckets, low=low, high=high, title=f"Histogram of {name}")
    return (
        f"<figure>{drawn}<figcaption><b>{name.capitalize()}</b>: {escape(MEANING[phase])}."
        f"{rest}</figcaption></figure>"
    )


def drawn_range(buckets: Sequence[Bucket]) -> tuple[float, float]:
    """Return the drawn range of a histogram, with a margin.

    It omits 0.1 % of the cycles at each end, because a single outlier would compress the bars.
    """
    total = sum(count for *_, count in buckets)
    ranks = list(accumulate(count for *_, count in buckets))
    low = next(b[0] for b, rank in zip(buckets, ranks, strict=True) if rank > total * 0.001)
    high = next(b[1] for b, rank in zip(buckets, ranks, strict=True) if rank >= total * 0.999)
    room = 0.1 * max(high - low, 0.1)
    return max(low - room, buckets[0][0]), high + room


def device_table(devices: Sequence[Device]) -> str:
    rows = "".join(
        f"<tr><td>{d.position}</td><td>{escape(d.name)}</td><td>0x{d.vendor:08X}</td>"
        f"<td>0x{d.product:08X}</td><td>{escape(d.state)}</td></tr>"
        for d in devices
    )
    return (
        '<div class="table words"><table><thead><tr><th>position</th><th>name</th><th>vendor</th>'
        f"<th>product</th><th>state</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


def thousands(value: int) -> str:
    return f"{value:,}".replace(",", "\u202f")
