"""Performance limits of the execution modes, checked by `python -m benchmarks loop`.

    .venv/bin/python -m benchmarks.acceptance --seconds 20 --out benchmarks/results/MACHINE/DATE
    .venv/bin/python -m benchmarks.acceptance --judge benchmarks/results/amd-epyc/2026-11-22

The first command runs three settings and writes acceptance-3.json, acceptance-33.json and
acceptance-busy.json. The second one judges existing files. The exit status does not depend on the
limits, because a benchmark on a shared machine is not a test.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

BUSY_WAIT = 50e-6  # [s]
SETTINGS: Mapping[str, str] = {
    "3": "--drives 3 --peers c,pysoem",
    "33": "--drives 33 --peers c,pysoem",
    "busy": f"--drives 3 --peers c,c-busy --busy-wait {BUSY_WAIT:.6f}",
}


class Aim(NamedTuple):
    """An upper limit of one ratio of `python -m benchmarks loop`."""

    setting: str  # a key of SETTINGS
    ratio: str
    limit: float


AIMS = (
    Aim("3", "wake_to_sent: catenary-law / c", 1.0),
    Aim("33", "wake_to_sent: catenary-law / c", 0.85),
    Aim("3", "cpu_per_cycle: catenary-law / c", 2.6),
    Aim("33", "cpu_per_cycle: catenary-law / c", 2.6),
    Aim("3", "in_controller: catenary-inline / pysoem", 0.74),
    Aim("3", "cpu_per_cycle: catenary-inline / pysoem", 1.04),
    Aim("3", "wake_to_sent: catenary-threaded / c", 1.2),
    Aim("33", "wake_to_sent: catenary-threaded / c", 1.2),
    Aim("busy", "wake_to_sent: catenary-law / c-busy", 0.9),
    Aim("busy", "wake_to_sent: catenary-inline / c-busy", 1.4),
)


def main(arguments: Sequence[str]) -> int:
    asked = parse(arguments)
    folder = asked.judge or asked.out
    if not asked.judge:
        for setting in SETTINGS:
            words = ["-m", "benchmarks", *command(setting, asked.seconds, folder)]
            print(f"\n--- python {' '.join(words)}", flush=True)
            done = subprocess.run([sys.executable, *words], check=False)
            if done.returncode:
                return done.returncode
    found = {name: json.loads(result(folder, name).read_text())["ratios"] for name in SETTINGS}
    print("\n" + "\n".join(verdicts(found)))
    return 0


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.acceptance",
        description="Run `python -m benchmarks loop` with 3 drives, with 33 drives and with a "
        "busy-wait, and compare the ratios with their limits.",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=20.0,
        metavar="S",
        help="run time of every peer in each setting (default: 20)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help="folder for the JSON files (default: .)",
    )
    parser.add_argument(
        "--judge", type=Path, metavar="FOLDER", help="judge the JSON files there without a run"
    )
    return parser.parse_args(arguments)


def command(setting: str, seconds: float, folder: Path) -> list[str]:
    """Return the command of a setting and its options."""
    options = [*SETTINGS[setting].split(), "--seconds", f"{seconds:g}"]
    return ["loop", *options, "--json", str(result(folder, setting))]


def result(folder: Path, setting: str) -> Path:
    """Return the path of a setting's JSON file."""
    return folder / f"acceptance-{setting}.json"


def verdicts(found: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return one line per limit. `found` holds the ratios of each setting."""
    lines = [f"{'setting':8}{'ratio':46}{'limit':>7}{'found':>8}"]
    for setting, ratio, limit in AIMS:
        value = found[setting].get(ratio)
        words = "not measured" if value is None else "reached" if value <= limit else "NOT REACHED"
        number = "-" if value is None else f"{value:.3f}"
        lines.append(f"{setting:8}{ratio:46}{limit:7.2f}{number:>8}  {words}")
    return lines


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
