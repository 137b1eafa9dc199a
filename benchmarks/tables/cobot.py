"""`python -m benchmarks table cobot`: six tasks of a six-axis cobot.

The table runs the program of `examples/cobot` and reads its results. In virtual time, execution
times are declared, and the table shows the schedule. On the machine's clock (`--realtime`), they
are measured, with real frames over a pair of interfaces.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from benchmarks.tables.published import COBOT, COBOT_UTILISATION
from benchmarks.tables.sheet import Options, Sheet
from benchmarks.task_times import TaskTimes, as_table
from catenary.errors import CatenaryError

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAM = Path("examples", "cobot", "cobot.py")
NEEDS = ("mujoco", "ruckig", "mcap")
SECONDS = 3600.0  # [s] limit; the program ends by itself
CONDITIONS = (
    "theirs: PyIgH on an Indy7, cyclic torque at 1 kHz, PREEMPT_RT, 5 min, joints 0 to 90 degrees"
)


def measure(options: Options) -> Sheet:
    reason = why_not(options)
    found = {} if reason else run(program(options), words_for(options))
    ours = {each["name"]: times_of(each) for each in found.get("tasks", ())}
    theirs = {f"{name} (theirs)": times for name, times in COBOT.items()}
    lines = [as_table(ours, COBOT) if ours else as_table(theirs, {})]
    lines.append(f"theirs: utilisation {COBOT_UTILISATION:.1%}, schedulable")
    clock = "the machine's clock" if options.realtime else "virtual time, execution declared"
    return Sheet(
        title=f"Six tasks of a six-axis cobot; {CONDITIONS}",
        conditions=f"ours: examples/cobot, a simulated arm, {moves(options)}; {clock}",
        text="\n".join([*lines, *as_lines(found)]),
        figures={
            "published": {name: times._asdict() for name, times in COBOT.items()},
            "published_utilisation": COBOT_UTILISATION,
            "realtime": options.realtime,
            "stretch": options.stretch,
            "ours": found,
        },
        left_out=[reason] if reason else [],
    )


def words_for(options: Options) -> list[str]:
    words = ["--headless", *(["--short"] if options.short else [])]
    words += [] if options.stretch is None else ["--stretch", str(options.stretch)]
    return [*words, *(["--realtime"] if options.realtime else [])]


def moves(options: Options) -> str:
    periods = "" if options.stretch is None else f", periods {options.stretch:g} times as long"
    return "twice there and back" + periods


def program(options: Options) -> Path:
    """Return the chosen program, or that of this repository."""
    if options.example is not None:
        return options.example
    return REPOSITORY / PROGRAM


def why_not(options: Options) -> str:
    path = program(options)
    if not path.exists():
        return f"all of ours: {path} does not exist (give its path with --example)"
    missing = [name for name in NEEDS if find_spec(name) is None]
    if missing:
        return f"all of ours: {', '.join(missing)} not installed (pip install 'catenary[cobot]')"
    return ""


def run(path: Path, words: Sequence[str]) -> dict[str, Any]:
    """Run the program and return its report, see `benchmarks.cobot.report`.

    Raises:
        CatenaryError: The program failed.
    """
    with tempfile.TemporaryDirectory(prefix="catenary-bench-") as name:
        command = [str(path), *words, "--out", name]
        if "--realtime" in words:
            command = ["-m", "catenary.realtime.private_network", *command]
        done = subprocess.run(
            [sys.executable, *command], capture_output=True, text=True, timeout=SECONDS, check=False
        )
        file = Path(name, "cobot.json")
        if done.returncode or not file.exists():
            last = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()
            raise CatenaryError(
                f"{path} failed: {last[-1]}", hint=f"run it separately: {sys.executable} {path}"
            )
        found: dict[str, Any] = json.loads(file.read_text())
        return found


def times_of(task: Mapping[str, Any]) -> TaskTimes:
    period, jitter, response = (tuple(task[name]) for name in ("period", "jitter", "response"))
    return TaskTimes(period, jitter, response)


def as_lines(found: Mapping[str, Any]) -> Sequence[str]:
    if not found:
        return []
    word = "schedulable" if found["schedulable"] else "NOT schedulable"
    without = found["rms_deg_without"]
    beyond = ", ".join(found["beyond"]) or "none"
    return [
        f"ours: utilisation {found['utilisation']:.1%}, {word}; "
        f"tracking {found['rms_deg']:.3f} deg rms"
        + ("" if without is None else f", without compensation {without:.3f}")
        + f"; {found['times_real_time']:.1f} times real time",
        "bounds of the analysis [us]: "
        + ", ".join(
            f"{name} {'none' if bound is None else round(bound)}"
            for name, bound in found["bounds_us"].items()
        ),
        f"responses beyond their bound: {beyond}",
    ]
