"""Progress of a long transfer, in one line of the terminal."""

from __future__ import annotations

import sys
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
