"""Report of an examination, as text with advice for each check, or as JSON."""

from __future__ import annotations

import json
import re
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence

from catenary.doctor.change import Change, Ground
from catenary.doctor.check import Check, Status
from catenary.doctor.examination import Examination
from catenary.doctor.latency import Latency
from catenary.figures import FIGURES

COLOURS = {"PASS": "\033[32m", "WARN": "\033[33m", "FAIL": "\033[31m", "SKIP": "\033[2m"}
PLAIN = "\033[0m"
WIDTH, NARROWEST = 100, 60
ID_WIDTH = 22
INDENT = " " * (2 + 6 + ID_WIDTH)
BAR = 40  # characters
STEPS_US = (2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 50_000)
COMMAND = re.compile(r"`[^`]*`|\b(?:sudo|echo|printf) [^;]*")
UNBROKEN = "\0"
BEYOND = 10**9  # stands for the step above the last one
NOUNS: dict[Status, str] = {
    "PASS": "passed",
    "WARN": "warnings",
    "FAIL": "failed",
    "SKIP": "unknown",
}


def as_text(examination: Examination, *, colour: bool = False, width: int = WIDTH) -> str:
    """Return the report as text.

    Args:
        examination: Results of the checks.
        colour: True to colour the statuses with escape sequences.
        width: Width of the lines; at least NARROWEST.
    """
    lines = []
    for title, checks in examination.groups:
        lines += ["", title[:1].upper() + title[1:]]
        for check in checks:
            lines += check_lines(check, colour, max(width, NARROWEST))
    if examination.latency is not None:
        lines += histogram_lines(examination.latency)
    return "\n".join([*lines[1:], "", *summary_lines(examination, width)])


def check_lines(check: Check, colour: bool, width: int) -> Iterator[str]:
    status = f"{COLOURS[check.status]}{check.status}{PLAIN}" if colour else check.status
    first, *rest = wrap(check.found, width - len(INDENT))
    yield f"  {status}  {check.id:{ID_WIDTH}}{first}"
    yield from (INDENT + line for line in rest)
    if check.advice:
        first, *rest = wrap(check.advice, width - len(INDENT) - 2)
        yield f"{INDENT}> {first}"
        yield from (f"{INDENT}  {line}" for line in rest)


def wrap(text: str, width: int) -> list[str]:
    """Wrap a text, but keep each command and quoted part on one line so that it can be copied."""
    kept = COMMAND.sub(lambda found: found[0].replace(" ", UNBROKEN), text)
    lines = textwrap.wrap(kept, width, break_long_words=False, break_on_hyphens=False) or [""]
    return [line.replace(UNBROKEN, " ") for line in lines]


def histogram_lines(latency: Latency) -> Iterator[str]:
    """Yield the lines of a histogram of latencies, with steps of 2, 5, 10, ... us."""
    counts = by_steps(latency)
    most = max(counts.values(), default=0)
    for step in sorted(counts):
        bar = "#" * max(1, round(counts[step] / most * BAR))
        yield f"{INDENT}{step_text(step):>18}  {counts[step]:8d}  {bar}"


def step_text(step: int) -> str:
    if step == BEYOND:
        return f"more than {STEPS_US[-1]} us"
    lower = max((below for below in STEPS_US if below < step), default=0)
    return f"{lower} to {step} us"


def by_steps(latency: Latency) -> dict[int, int]:
    """Sum the buckets by steps; the upper edge of a bucket selects its step."""
    counts: dict[int, int] = {}
    for _, above, count in latency.histogram:
        step = next((step for step in STEPS_US if above * 1e6 <= step), BEYOND)
        counts[step] = counts.get(step, 0) + count
    return counts


def summary_lines(examination: Examination, width: int) -> Iterator[str]:
    counted = Counter(check.status for check in examination.checks)
    counts = ", ".join(f"{counted[status]} {noun}" for status, noun in NOUNS.items())
    yield f"{len(examination.checks)} checks: {counts}"
    if failed := [check.id for check in examination.checks if check.status == "FAIL"]:
        words = f"This machine is not ready for a real-time loop. Fix first: {', '.join(failed)}"
        yield from wrap(words, width)
    elif counted["WARN"]:
        yield "A loop can run here. The warnings show possible causes of late cycles."
    elif examination.latency is None:
        yield "No check failed or warned, but the wake-up latency was not measured."
    else:
        yield "This machine is ready for a real-time loop: no check failed or warned."
    if examination.changes:
        settings = (
            "1 setting" if len(examination.changes) == 1 else f"{len(examination.changes)} settings"
        )
        yield f"--apply can change {settings}; the changes last until the next reboot."
    yield "docs/how_to/doctor.md explains each check."


def change_lines(changes: Sequence[Change], ground: Ground) -> Iterator[str]:
    """Yield a line for each change, with the current value in `ground` and the new value."""
    for change in changes:
        try:
            now = ground.read(change.target)
        except OSError as error:
            now = f"(unknown: {error.strerror})"
        yield f"  {change.target}: {now} -> {change.after}"


def as_json(examination: Examination) -> str:
    """Return the examination as JSON.

    `latency_us` is empty if the latency was not measured. Its times are in us, except `seconds`.
    """
    return json.dumps(
        {
            "checks": [
                {
                    "id": check.id,
                    "status": check.status,
                    "found": check.found,
                    "advice": check.advice,
                }
                for check in examination.checks
            ],
            "latency_us": latency_us(examination.latency) if examination.latency else {},
        },
        indent=2,
    )


def latency_us(latency: Latency) -> dict[str, object]:
    figure = latency.lateness
    times = FIGURES
    return {
        "seconds": latency.seconds,
        "period": latency.period * 1e6,
        "cpu": latency.cpu,
        "scheduling": latency.scheduling,
        "count": figure.count,
        "missed": latency.missed,
        **{name: round(getattr(figure, name) * 1e6, 3) for name in times},
        "histogram": [
            [round(low * 1e6, 3), round(above * 1e6, 3), count]
            for low, above, count in latency.histogram
        ],
    }
