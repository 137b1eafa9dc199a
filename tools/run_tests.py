"""Run the tests in several processes at the same time: `python tools/run_tests.py [OPTION ...]`.

Most tests in real time wait, and need the processor at once when they stop waiting. They run in the
first process. The tests in the folders `PATIENT` start other programs and wait for them, with long
deadlines. The tests in the folders of `VIRTUAL` use virtual time or none. Both run at lower
priorities in further processes: `VIRTUAL` in two processes on a machine with four processors.
Each process has its own private network. With arguments other than `--require MARKER`, for example
a path or `-k NAME`, one process runs the selected tests.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Collection, Sequence
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent / "tests"
PATIENT = ("browser", "ros2")
MARKERS = {"browser", "ros2", "rtlab", "shared_data", "tshark", "wire"}  # of tests/conftest.py
PATIENT_MARKERS = {"browser", "ros2"}  # of tests in these folders
VIRTUAL = (
    (
        *("bus", "capture", "cli", "core", "docs", "drive", "esi", "fuzz", "igh", "line"),
        *("machine", "model", "plan", "procedure", "programs", "pyigh", "quirk", "record"),
        *("virtual", "wire"),
    ),
    ("control", "examples"),
)
PYTEST = (sys.executable, "-m", "catenary.realtime.private_network", "-m", "pytest")
PATIENT_PRIORITY, LOW_PRIORITY = 3, 5  # nice(1)
PROCESSORS = 4  # of a machine that runs each group of VIRTUAL in its own process
SLOWEST = "--durations=25"


def main(arguments: Sequence[str]) -> int:
    """Run the tests, and return the exit status of pytest."""
    if not only_requires(arguments):
        return subprocess.call([*PYTEST, *arguments])
    colour = ["--color=yes"] if sys.stdout.isatty() else []
    options = [SLOWEST, *colour, *arguments]
    runs = {"in real time": Run("", [*options, *ignored(), *elsewhere(PATIENT_MARKERS)])}
    others = elsewhere(MARKERS - PATIENT_MARKERS)
    runs["patient"] = Run("patient: ", [*options, *others, *paths(PATIENT)], PATIENT_PRIORITY)
    for number, folders in enumerate(groups(len(os.sched_getaffinity(0))), 1):
        name = f"virtual {number}"
        given = [*options, *elsewhere(MARKERS), *paths(folders)]
        runs[name] = Run(f"{name}: ", given, LOW_PRIORITY)
    statuses = {name: each.wait() for name, each in runs.items()}
    print("Exit status:", ", ".join(f"{status} {name}" for name, status in statuses.items()))
    return first_failure(list(statuses.values()))


def groups(processors: int) -> list[tuple[str, ...]]:
    """Return the folders of each process in virtual time, for a number of processors."""
    if processors >= PROCESSORS:
        return list(VIRTUAL)
    return [tuple(folder for group in VIRTUAL for folder in group)]


def paths(folders: Sequence[str]) -> list[str]:
    """Return the paths of folders of tests."""
    return [f"tests/{folder}" for folder in folders]


def ignored() -> list[str]:
    """Return the options of the process in real time, which runs all other folders."""
    others = [*PATIENT, *(folder for group in VIRTUAL for folder in group)]
    return [f"--ignore={path}" for path in paths(others)]


def elsewhere(markers: Collection[str]) -> list[str]:
    """Return the options for markers that need no test in a process."""
    return [f"--elsewhere={marker}" for marker in sorted(markers)]


def first_failure(statuses: Sequence[int]) -> int:
    """Return the first status that is not 0. It is negative if a signal ended the process."""
    return next((status for status in statuses if status), 0)


def only_requires(arguments: Sequence[str]) -> bool:
    """Return whether all arguments are pairs of `--require` and a marker."""
    return len(arguments) % 2 == 0 and all(each == "--require" for each in arguments[::2])


class Run:
    """Process of pytest. Each complete line of its output is printed with a prefix."""

    def __init__(self, prefix: str, options: Sequence[str], niceness: int = 0) -> None:
        self._prefix = prefix
        self._process = subprocess.Popen(
            ["nice", "-n", str(niceness), *PYTEST, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=TESTS.parent,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self._printer = threading.Thread(target=self._print)
        self._printer.start()

    def _print(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            sys.stdout.buffer.write(self._prefix.encode() + line)
            sys.stdout.buffer.flush()

    def wait(self) -> int:
        """Wait for the end of the tests, and return the exit status."""
        try:
            status = self._process.wait()
        except KeyboardInterrupt:  # pytest received the signal too, and ends
            status = self._process.wait()
        self._printer.join()
        return status


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
