"""Common parts of the steps of a release: folders, version, and the start of programs."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LAST_LINES = 15  # of the output of a program that failed


class Failure(Exception):
    """A reason against the release."""


@dataclass(frozen=True)
class Release:
    """A release of the clone at `root`, with its files in `out`."""

    root: Path
    out: Path
    quick: bool = False

    @cached_property
    def version(self) -> str:
        """Version in pyproject.toml."""
        project = tomllib.loads((self.root / "pyproject.toml").read_text())["project"]
        return str(project["version"])

    @property
    def python(self) -> str:
        """Interpreter of the environment of the clone."""
        own = self.root / ".venv" / "bin" / "python"
        return str(own) if own.exists() else sys.executable

    def run(self, command: Sequence[str], environment: Mapping[str, str] | None = None) -> str:
        """Run a program in the clone, and return its output.

        Args:
            command: Program and arguments.
            environment: Further variables.

        Raises:
            Failure: The program failed or does not exist. The last lines of its output follow.
        """
        try:
            done = subprocess.run(
                command,
                cwd=self.root,
                env={**os.environ, **(environment or {})},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                check=False,
            )
        except OSError as error:
            raise Failure(f"{command[0]}: {error.strerror}") from error
        if done.returncode:
            last = "\n      ".join(done.stdout.splitlines()[-LAST_LINES:])
            raise Failure(f"{' '.join(command)}: exit status {done.returncode}\n      {last}")
        return done.stdout
