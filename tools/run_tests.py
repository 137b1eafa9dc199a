"""Run the tests in two processes at the same time: `python tools/run_tests.py [OPTION ...]`.

Most tests in real time wait, and need the processor at once when they stop waiting. The tests in
the folders `VIRTUAL` use virtual time or none. They run at low priority in a second process. Each
process has its own private network. With arguments other than `--require MARKER`, for example a
path or `-k NAME`, one process runs the selected tests.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent / "tests"
VIRTUAL = (
    *("bus", "capture", "cli", "control", "core", "docs", "drive", "esi", "examples", "fuzz"),
    *("igh", "line", "machine", "model", "plan", "procedure", "programs", "pyigh", "quirk"),
    *("record", "virtual", "wire"),
)
PYTEST = (sys.executable, "-m", "catenary.realtime.private_network", "-m", "pytest")
LOW_PRIORITY = 5  # nice(1)
SLOWEST = "--durations=25"


def main(arguments: Sequence[str]) -> int:
    """Run the tests, and return the exit status of pytest."""
    if not only_requires(arguments):
        return subprocess.call([*PYTEST, *arguments])
    colour = ["--color=yes"] if sys.stdout.isatty() else []
    folders = [f"tests/{name}" for name in VIRTUAL]
    options = [SLOWEST, *colour, *arguments]
    virtual = Run("virtual: ", [*options, "--part", *folders], LOW_PRIORITY)
    real = Run("", [*options, *(f"--ignore={folder}" for folder in folders)])
    statuses = [each.wait() for each in (real, virtual)]
    print(f"Exit status: {statuses[0]} in real time, {statuses[1]} in virtual time")
    return first_failure(statuses)


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
