"""Child processes that end with this process.

Each child has its own session, so a Ctrl-C in the terminal does not reach it. This process can
therefore first end everything that depends on the child, and then the child. If this process dies,
the kernel sends SIGTERM to the child.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import runpy
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import IO, Self

PR_SET_PDEATHSIG = 1  # linux/prctl.h


class Child:
    """Owner of one child process and of the pipe from its standard output."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process
        self.unread = b""

    @property
    def pid(self) -> int:
        """Process id of the child."""
        return self.process.pid

    @property
    def running(self) -> bool:
        """True until the child ends."""
        return self.process.poll() is None

    def read_line(self, seconds: float) -> str | None:
        """Wait for the next line of output, and return it without its line feed.

        Return None at the end of the output or after `seconds`.
        """
        output = self.process.stdout
        assert output is not None
        deadline = time.monotonic() + seconds
        while b"\n" not in self.unread:
            if not wait_readable(output, deadline):
                return None
            read = os.read(output.fileno(), 4096)
            if not read:
                return None
            self.unread += read
        line, _, self.unread = self.unread.partition(b"\n")
        return line.decode(errors="replace")

    def end(self, seconds: float = 3.0) -> int:
        """Send SIGTERM, and SIGKILL after `seconds`. A child that has ended receives neither.

        Wait for the child, close the pipe, and return the exit status. It is negative for the
        signal that killed the child.
        """
        if self.running:
            with contextlib.suppress(ProcessLookupError):
                self.process.terminate()
            try:
                self.process.wait(seconds)
            except subprocess.TimeoutExpired:
                self.process.kill()
        status = self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        return status

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()


def wait_readable(output: IO[bytes], deadline: float) -> bool:
    left = max(deadline - time.monotonic(), 0.0)
    return bool(select.select([output], [], [], left)[0])


def start_python(arguments: Sequence[str]) -> Child:
    """Start a child that runs this interpreter with `-m module ...` or `script.py ...`.

    Raises ValueError if the module or script is missing.
    """
    if not arguments or (arguments[0] == "-m" and len(arguments) < 2):
        raise ValueError("arguments must be `-m module ...` or `script.py ...`")
    command = [sys.executable, "-m", "catenary.realtime.child", str(os.getpid()), *arguments]
    return Child(subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True))


def start_program(command: Sequence[str]) -> Child:
    """Start any program as a child. Raises ValueError for an empty command."""
    if not command:
        raise ValueError("the command is empty; give the name of a program")
    own = [sys.executable, "-m", "catenary.realtime.child", str(os.getpid()), "--exec", *command]
    return Child(subprocess.Popen(own, stdout=subprocess.PIPE, start_new_session=True))


def end_with_parent(parent: int) -> None:
    """Make the kernel send SIGTERM to this process when `parent` ends. Exit if it has ended.

    Call this in the child itself. Executing an interpreter with file capabilities, as recommended
    to ordinary users, clears a parent-death signal set earlier, prctl(2).
    """
    if ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM) != 0 or os.getppid() != parent:
        sys.exit("the parent process has ended")


def main(arguments: Sequence[str]) -> None:
    end_with_parent(int(arguments[0]))
    if arguments[1] == "--exec":
        os.execvp(arguments[2], list(arguments[2:]))
    if arguments[1] == "-m":
        sys.argv = list(arguments[2:])
        runpy.run_module(arguments[2], run_name="__main__", alter_sys=True)
    else:
        sys.argv = list(arguments[1:])
        runpy.run_path(arguments[1], run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
