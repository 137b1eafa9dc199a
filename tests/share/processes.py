"""Programs in separate processes, for tests that kill them."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Event

DEADLINE = 60.0  # [s] a loaded machine can pause for a long time

LOOP = """
import sys
import catenary as cat
from catenary.virtual import Segment, Servo
with cat.MainDevice(Segment([Servo(), Servo()])) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
    share = cat.Share(sys.argv[1])
    with share, cat.Loop(arm, sink=share) as loop:
        for cycle in loop:
            arm.target.position[:] = 1e-6 * cycle.number
            if cycle.number == 100:
                print("running", flush=True)
"""  # virtual time: thousands of cycles per second, without waiting


class Program:
    """Owns a process."""

    def __init__(self, text: str, *arguments: str) -> None:
        self._start([sys.executable, "-c", text, *arguments])

    @classmethod
    def of(cls, command: Sequence[str]) -> Program:
        """Start any command."""
        program = cls.__new__(cls)
        program._start(command)
        return program

    def _start(self, command: Sequence[str]) -> None:
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def line(self) -> str:
        """Return the next line of its standard output."""
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(DEADLINE)

    def close(self) -> None:
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


@contextmanager
def started(text: str, *arguments: str) -> Iterator[Program]:
    program = Program(text, *arguments)
    try:
        yield program
    finally:
        program.kill()
        program.close()


def comes_true(condition: Callable[[], bool]) -> bool:
    """Return True as soon as the condition holds, and False after DEADLINE."""
    pause = Event()
    for _ in range(round(DEADLINE / 0.01)):
        if condition():
            return True
        pause.wait(0.01)
    return False
