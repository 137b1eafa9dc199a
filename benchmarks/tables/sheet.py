"""Options of a table and its results, as text and as JSON."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from catenary.bench.report import machine
from catenary.realtime.system.scheduling import current_scheduling

RATIOS = "other machines: compare ratios, not microseconds"
PACKAGES = ("catenary", "numpy", "numba", "pysoem")


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the command line; None for the default of the table."""

    seconds: float | None = None
    rounds: int | None = None  # smallest number of rounds in which programs take turns
    rates: tuple[int, ...] | None = None  # [Hz]
    peers: tuple[str, ...] | None = None  # programs to compare
    ring: bool = False
    axes: tuple[int, ...] | None = None  # drives on each network
    busy_wait: float = 0.0  # [s] of our loops before each cycle start
    example: Path | None = None  # program of examples/cobot
    realtime: bool = False  # True to use the machine's clock instead of virtual time
    stretch: float | None = None  # factor of the periods, for a slow processor
    short: bool = False  # True for one run of the cobot
    refused: str = ""  # reason why there is no private network


@dataclass(frozen=True, slots=True)
class Sheet:
    """One table: text with their figures and ours, the figures, and the reasons for omissions."""

    title: str
    conditions: str  # ours
    text: str
    figures: Mapping[str, object]
    left_out: Sequence[str] = ()


def show(sheet: Sheet) -> str:
    lines = [f"{sheet.title}\n{machine()}\n{sheet.conditions}; {RATIOS}\n", sheet.text]
    lines += [f"left out: {reason}" for reason in sheet.left_out]
    return "\n".join(lines)


def as_json(name: str, sheet: Sheet) -> str:
    return json.dumps(
        {
            "table": name,
            "title": sheet.title,
            "machine": machine(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]]),
            "versions": versions(),
            "cpus": sorted(os.sched_getaffinity(0)),
            "scheduling": str(current_scheduling()),
            "conditions": sheet.conditions,
            "note": RATIOS,
            "left_out": list(sheet.left_out),
            **sheet.figures,
        },
        indent=1,
    )


def versions() -> dict[str, str]:
    """Return the versions of Python and of the installed packages."""
    found = {"python": sys.version.split()[0]}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def as_failures(failed: Sequence[str]) -> list[str]:
    """Return a line about repeated rounds, whose failed attempts are not in the figures."""
    if not failed:
        return []
    return [f"rounds that failed and were repeated: {len(failed)} (the first: {failed[0][:110]})"]


def grid(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows as aligned text: the first column on the left, the others on the right."""
    table = [header, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(header))]
    return "\n".join(
        "  ".join(
            text.ljust(width) if k == 0 else text.rjust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    )


def slashed(values: Sequence[float | None], digits: int) -> str:
    """Return values as "8.849/44.000/..."; a dash stands for an unpublished value."""
    return "/".join("-" if value is None else f"{value:.{digits}f}" for value in values)
