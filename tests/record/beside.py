"""A loop that shares its cycles in virtual time, and a recorder in a separate process."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import catenary as cat

PERIOD = 1e-3
DEADLINE = 60.0  # [s] for another process, even on a machine under heavy load


@dataclass
class SharedLoop:
    """A loop that runs for a number of cycles on request."""

    loop: cat.Loop
    arm: cat.Drives
    share: cat.Share

    def run(self, cycles: int) -> None:
        home = self.arm.actual.position.copy()
        for done, cycle in enumerate(self.loop):
            if done == cycles:
                break
            self.arm.target.position[:] = home + 0.1 * min(done / 1000, 1.0)
            assert cycle.ok


@contextmanager
def shared_loop(name: str, *, axes: int = 3, history: float = 30.0) -> Iterator[SharedLoop]:
    """Open a loop with a share.

    The default history is so long that a late or slow recorder loses nothing.
    """
    segment = cat.Segment([cat.virtual.Coupler(), *(cat.virtual.Servo() for _ in range(axes))])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with (
            cat.Share(name, history=history) as share,
            cat.Loop(arm, period=PERIOD, sink=share) as loop,
        ):
            yield SharedLoop(loop, arm, share)


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "catenary.cli", *map(str, arguments)]


@contextmanager
def recorder(*arguments: object, wrap: tuple[str, ...] = ()) -> Iterator[subprocess.Popen[str]]:
    """Run `catenary record ...`; start the block when it is recording, and kill it afterwards."""
    with subprocess.Popen(
        [*wrap, *command("record", *arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        try:
            assert child.stdout is not None
            assert child.stdout.readline().startswith("recording ")
            yield child
        finally:
            child.kill()


def until(condition: Callable[[], bool]) -> bool:
    """Wait for a condition in real time. Return False if it does not hold before the deadline."""
    deadline = time.monotonic() + DEADLINE
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.01)  # another process has no virtual clock to wait for
    return False


def has_bytes(path: Path, count: int) -> Callable[[], bool]:
    return lambda: path.exists() and path.stat().st_size >= count
