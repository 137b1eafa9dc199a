"""`python -m benchmarks scan`: number of frames and time to PRE-OP, for Catenary and PySOEM.

The kernel counts the frames on the wire. Each master brings up the same segment in a new process.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec

import catenary as cat
from benchmarks.needed import need
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.bench.segment import served
from catenary.errors import CatenaryError
from catenary.realtime.child import start_python

REPEATS = 5
SECONDS = 120.0  # [s] limit of one bring-up


@dataclass(frozen=True, slots=True)
class BringUp:
    devices: int
    frames: int
    bytes: int
    seconds: float


def measure(*, drives: int, file: Path | None) -> None:
    need("pysoem")
    with served(drives) as segment:
        found = {name: repeat(name, segment.interface) for name in WAYS}
    ours, theirs = found["catenary"], found["pysoem"]
    print(f"{machine()}\n{ours.devices} devices to PRE-OP, medians of {REPEATS}")
    for name, one in found.items():
        print(f"  {name:10} {one.frames:7d} frames {one.bytes:9d} bytes {one.seconds:8.3f} s")
    print(f"  frames: {ours.frames / theirs.frames:.3f} of PySOEM's")
    figures = {name: asdict(one) for name, one in found.items()}
    write(file, {"machine": machine(), "drives": drives, "bring_up": figures})


def repeat(name: str, interface: str) -> BringUp:
    ones = [once(name, interface) for _ in range(REPEATS)]
    return BringUp(
        devices=ones[0].devices,
        frames=round(statistics.median(one.frames for one in ones)),
        bytes=round(statistics.median(one.bytes for one in ones)),
        seconds=statistics.median(one.seconds for one in ones),
    )


def once(name: str, interface: str) -> BringUp:
    """Bring the segment up in a new process, and return the result."""
    with start_python(["-m", "benchmarks.scan", name, interface]) as worker:
        line = worker.read_line(SECONDS)
    if line is None:
        raise CatenaryError(f"{name} did not bring the segment up within {SECONDS:.0f} s")
    return msgspec.json.decode(line, type=BringUp)


@contextmanager
def with_catenary(interface: str) -> Iterator[int]:
    # PySOEM does not check for another master, either.
    with cat.MainDevice(interface, force=True) as main:
        yield len(main.scan())


@contextmanager
def with_pysoem(interface: str) -> Iterator[int]:
    import pysoem

    master = pysoem.Master()
    master.open(interface)
    try:
        found = int(master.config_init())
        if master.state_check(pysoem.PREOP_STATE, 5_000_000) != pysoem.PREOP_STATE:
            raise RuntimeError("PySOEM did not reach PRE-OP")
        yield found
    finally:
        master.close()


WAYS: dict[str, Callable[[str], AbstractContextManager[int]]] = {
    "catenary": with_catenary,
    "pysoem": with_pysoem,
}


def sent(interface: str) -> tuple[int, int]:
    """Return the frames and bytes sent in this namespace so far, as counted by the kernel."""
    for line in Path("/proc/self/net/dev").read_text().splitlines():
        name, _, counts = line.partition(":")
        if name.strip() == interface:
            numbers = counts.split()
            return int(numbers[9]), int(numbers[8])
    raise CatenaryError(f"the kernel has no counters for {interface}")


def main(arguments: Sequence[str]) -> None:
    name, interface = arguments
    frames_before, bytes_before = sent(interface)
    start = time.monotonic()
    with WAYS[name](interface) as devices:
        seconds = time.monotonic() - start
        frames, size = sent(interface)
    one = BringUp(devices, frames - frames_before, size - bytes_before, seconds)
    print(msgspec.json.encode(one).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
