"""A line of virtual devices on a network interface, and programs that use it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from catenary.realtime.child import Child, start_python

START = 20.0  # [s] at most
LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "servo"
name = "shoulder"
"""

# A loop that cycles until its standard input ends, and prints what it sees. On a machine that is
# shared with other work, lost frames must not end it.
LOOP = """
import sys
import catenary as cat

def main(interface, run):
    with cat.MainDevice(interface) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        options = dict(
            execution=run,
            period=4e-3,
            stop=cat.StopPolicy(lost_limit=1000),
            watchdog=0.5,
            priority=None,
        )
        with cat.Loop(arm, **options) as loop:
            print("running", flush=True)
            for cycle in loop:
                arm.target.position[:] = arm.actual.position
                if cycle.number % 25 == 0:
                    print(cycle.number, cycle.ok, arm.stopped == (None,), flush=True)

try:
    main(*sys.argv[1:])
except cat.CatenaryError as error:
    print(type(error).__name__, *str(error).split(), flush=True)
"""


@contextlib.contextmanager
def served(interface: str, folder: Path) -> Iterator[None]:
    """Serve the line on an interface."""
    file = folder / "line.toml"
    file.write_text(LINE)
    command = ["-m", "catenary.cli", "virtual", "serve", interface, "--config", str(file)]
    with start_python(command) as server:
        assert server.read_line(START), "the virtual segment did not start"
        yield


@contextlib.contextmanager
def program(text: str, folder: Path, *arguments: str) -> Iterator[Child]:
    """Run a program in a process of its own."""
    file = folder / f"program{len(list(folder.glob('program*')))}.py"
    file.write_text(text)
    with start_python([str(file), *arguments]) as child:
        yield child


@contextlib.contextmanager
def looping(interface: str, folder: Path, run: str = "threaded") -> Iterator[Child]:
    """Run a loop on the line."""
    with program(LOOP, folder, interface, run) as child:
        assert child.read_line(START) == "running"
        yield child


def goes_on(child: Child) -> bool:
    """Return True if a loop runs further good cycles with power. A busy machine may lose some."""
    while child.read_line(0.0) is not None:
        pass
    seen = [child.read_line(START) or "ended" for _ in range(8)]
    return any(line.endswith("True True") for line in seen[-4:]) and seen[-1].endswith("True")
