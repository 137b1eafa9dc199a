"""Run the tests in two processes at the same time: `python tools/run_tests.py [OPTION ...]`.

Most tests in real time wait, and need the processor at once when they stop waiting. The tests in
the folders `VIRTUAL` use virtual time or none. They run at low priority in a second process. Each
process has its own private network. With arguments other than `--require MARKER`, for example a
path or `-k NAME`, one process runs the selected tests.

A test in real time can fail because the machine paused it. Up to `MOST_REPEATED` failed tests run
once more, alone, at the end. The last lines name them. More failures are not repeated.
"""

from __future__ import annotations

import json
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
    *("record", "release", "virtual", "wire"),
)
PYTEST = (sys.executable, "-m", "catenary.realtime.private_network", "-m", "pytest")
LOW_PRIORITY = 5  # nice(1)
SLOWEST = "--durations=25"
FAILED = 1  # exit status of pytest: tests failed
MOST_REPEATED = 3


def main(arguments: Sequence[str]) -> int:
    """Run the tests, and return the exit status of pytest."""
    if not only_requires(arguments):
        return subprocess.call([*PYTEST, *arguments])
    colour = ["--color=yes"] if sys.stdout.isatty() else []
    folders = [f"tests/{name}" for name in VIRTUAL]
    options = [SLOWEST, *colour, *arguments]
    runs = (
        Run("", "real", [*options, *(f"--ignore={folder}" for folder in folders)]),
        Run("virtual: ", "virtual", [*options, "--part", *folders], LOW_PRIORITY),
    )
    statuses = [run.wait() for run in runs]
    print(f"Exit status: {statuses[0]} in real time, {statuses[1]} in virtual time")
    failed = [test for run in runs for test in run.failed()]
    status = first_failure(statuses)
    return repeated(failed, [*colour, *arguments]) if may_repeat(statuses, failed) else status


def first_failure(statuses: Sequence[int]) -> int:
    """Return the first status that is not 0. It is negative if a signal ended the process."""
    return next((status for status in statuses if status), 0)


def may_repeat(statuses: Sequence[int], failed: Sequence[str]) -> bool:
    """Return whether tests failed, not more than `MOST_REPEATED`, and nothing else."""
    return set(statuses) <= {0, FAILED} and 0 < len(failed) <= MOST_REPEATED


def repeated(failed: Sequence[str], options: Sequence[str]) -> int:
    """Run the failed tests alone, and return the exit status of pytest."""
    print(f"These tests failed, and run once more, alone: {', '.join(failed)}", flush=True)
    status = Run("again: ", "again", [*options, "--part", *failed]).wait()
    if status == 0:
        print(f"Passed only when repeated: {', '.join(failed)}")
    return status


def only_requires(arguments: Sequence[str]) -> bool:
    """Return whether all arguments are pairs of `--require` and a marker."""
    return len(arguments) % 2 == 0 and all(each == "--require" for each in arguments[::2])


class Run:
    """Process of pytest. Each complete line of its output is printed with a prefix."""

    def __init__(self, prefix: str, name: str, options: Sequence[str], niceness: int = 0) -> None:
        self._prefix = prefix
        cache = TESTS.parent / ".pytest_cache" / name
        self._failed = cache / "v" / "cache" / "lastfailed"
        self._failed.unlink(missing_ok=True)  # tests that an earlier run did not repeat
        self._process = subprocess.Popen(
            ["nice", "-n", str(niceness), *PYTEST, "-o", f"cache_dir={cache}", *options],
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

    def failed(self) -> list[str]:
        """Return the failed tests, which pytest has noted in its cache."""
        try:
            return list(json.loads(self._failed.read_text()))
        except FileNotFoundError:  # no test failed, or pytest ended early
            return []


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
