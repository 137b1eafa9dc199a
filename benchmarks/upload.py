"""Throughput of a segmented upload on an idle bus, for Catenary and PySOEM in turn.

Each run is a new process: `python -m benchmarks.upload NAME NIC POSITION`.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

import catenary as cat
from catenary.errors import CatenaryError
from catenary.realtime.child import start_python

LARGE = 0x2100  # object of the virtual servo: 2048 bytes, in segments of at most 119 bytes
TIMES = 20  # uploads per process
ROUNDS = 5
SECONDS = 60.0  # [s] limit of one process


@dataclass(frozen=True, slots=True)
class Upload:
    """Median of all uploads."""

    name: str
    size: int  # bytes
    seconds: float

    @property
    def kilobytes_per_second(self) -> float:
        return self.size / self.seconds * 1e-3

    def __str__(self) -> str:
        return (
            f"{self.name:10} {self.size} bytes in {self.seconds * 1e3:.2f} ms: "
            f"{self.kilobytes_per_second:.0f} kB/s"
        )


def measure(interface: str, position: int) -> list[Upload]:
    found: dict[str, list[Upload]] = {name: [] for name in WAYS}
    for _ in range(ROUNDS):
        for name in WAYS:
            found[name].append(once(name, interface, position))
    return [
        Upload(name, ones[0].size, statistics.median(one.seconds for one in ones))
        for name, ones in found.items()
    ]


def once(name: str, interface: str, position: int) -> Upload:
    arguments = ["-m", "benchmarks.upload", name, interface, str(position)]
    with start_python(arguments) as worker:
        line = worker.read_line(SECONDS)
    if line is None:
        raise CatenaryError(f"{name} did not read the object within {SECONDS:.0f} s")
    return msgspec.json.decode(line, type=Upload)


def with_catenary(interface: str, position: int) -> Upload:
    with cat.MainDevice(interface) as main:
        sub = main.scan()[position]
        return timed("catenary", lambda: sub.sdo.read(LARGE))


def with_pysoem(interface: str, position: int) -> Upload:
    import pysoem

    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= position:
            raise CatenaryError("PySOEM did not find the device")
        if master.state_check(pysoem.PREOP_STATE, 5_000_000) != pysoem.PREOP_STATE:
            raise CatenaryError("PySOEM did not reach PRE-OP")
        slave = master.slaves[position]
        return timed("pysoem", lambda: bytes(slave.sdo_read(LARGE, 0, 4096)))
    finally:
        master.close()


def timed(name: str, read: Callable[[], bytes]) -> Upload:
    size = len(read())
    took = []
    for _ in range(TIMES):
        start = time.perf_counter()
        read()
        took.append(time.perf_counter() - start)
    return Upload(name, size, statistics.median(took))


WAYS: dict[str, Callable[[str, int], Upload]] = {
    "catenary": with_catenary,
    "pysoem": with_pysoem,
}


def main(arguments: Sequence[str]) -> None:
    name, interface, position = arguments
    print(msgspec.json.encode(WAYS[name](interface, int(position))).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
