"""Progress of a long transfer, in one line of the terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Self

from catenary.cli.text import escaped


class Progress:
    """Progress line on stderr. It stays empty if stderr is not a terminal."""

    def __init__(self, verb: str, unit: str = "words") -> None:
        self._verb = verb
        self._unit = unit
        self._shown = sys.stderr.isatty()

    def __call__(self, done: int, total: int) -> None:
        if self._shown:
            line = f"\r{self._verb}: {done} of {total} {self._unit}"
            print(line, end="", file=sys.stderr, flush=True)

    def step(self, text: str, done: int, total: int) -> None:
        """Show the progress of one of several parts.

        Args:
            text: What is read.
            done: Number of units that were read.
            total: Number of units.
        """
        if self._shown:
            line = f"{escaped(text)}: {done} of {total}"
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


class TransferProgress(Progress):
    """Progress line of a file, with the rate and the remaining time."""

    def __init__(self, verb: str, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(verb, "bytes")
        self._clock = clock
        self._start: float | None = None

    def report(self, done: int, total: int | None, busy: str = "") -> None:
        """Show the progress.

        Args:
            done: Number of bytes that were transferred.
            total: Number of all bytes; None if it is not known.
            busy: Progress that a busy device reports.
        """
        now = self._clock()
        if self._start is None:
            self._start = now
        if self._shown:
            line = f"{self._verb}: {transfer_text(done, total, now - self._start)}"
            line += f", busy {escaped(busy)}" if busy else ""
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)

    def show(self, text: str) -> None:
        """Show a text, such as the name of a step."""
        if self._shown:
            print(f"\r\033[K{escaped(text)} ...", end="", file=sys.stderr, flush=True)


def transfer_text(done: int, total: int | None, seconds: float) -> str:
    """Return the progress of a transfer, such as "12.0 of 48.0 KiB, 25 %, 6.0 KiB/s, 6 s left".

    Args:
        done: Number of bytes that were transferred.
        total: Number of all bytes; None if it is not known.
        seconds: Time since the start [s].
    """
    parts = [f"{done / 1024:.1f} KiB"]
    if total is not None:
        percent = 100 * done // total if total else 100
        parts = [f"{done / 1024:.1f} of {total / 1024:.1f} KiB", f"{percent} %"]
    if done and seconds > 0:
        rate = done / seconds
        parts.append(f"{rate / 1024:.1f} KiB/s")
        if total is not None:
            parts.append(f"{(total - done) / rate:.0f} s left")
    return ", ".join(parts)
