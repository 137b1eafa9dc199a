"""`python -m benchmarks foe`: rate of file transfers, idle and next to a loop.

On an idle bus, Catenary and PySOEM transfer the same file in turn. Then Catenary transfers it while
a loop of 1 kHz runs.

The bound next to a loop follows from the mailbox and the acyclic queue: a packet has two exchanges,
its message and its answer, and the queue has one exchange per cycle. A full packet therefore takes
two cycles. The frames of 1 KiB fit into a cycle, so their wire time is not a limit.

Each run is a new process: `python -m benchmarks.foe NAME NIC SIZE`. `serve NIC CPU` is the process
of the segment.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

import catenary as cat
from benchmarks.needed import need
from catenary.bench.loop import write as write_figures
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.bench.report import machine
from catenary.bench.segment import PRIORITY, START_SECONDS, processors
from catenary.errors import CatenaryError, LinkError
from catenary.procedure.foe import OVERHEAD
from catenary.realtime.child import start_python
from catenary.realtime.private_network import veth_pair
from catenary.realtime.system.scheduling import request_scheduling
from catenary.virtual import Coupler, DeviceFiles, Segment, Servo
from catenary.virtual import serve as serve_segment

POSITION, MAILBOX, NAME = 1, 1024, "file"
PERIOD = 1e-3  # [s]
CYCLES_PER_PACKET = 2
SECONDS = 120.0  # [s] limit of one process
TIMEOUT_US = 5_000_000
ATTEMPTS = 3  # PySOEM ends a transfer after a late frame


@dataclass(frozen=True, slots=True)
class Transfer:
    """One transfer, or the median of several."""

    name: str
    size: int  # bytes
    seconds: float

    @property
    def kilobytes_per_second(self) -> float:
        return self.size / self.seconds * 1e-3

    def __str__(self) -> str:
        return f"{self.name:20} {self.seconds:7.3f} s {self.kilobytes_per_second:9.0f} kB/s"


def bound(size: int) -> float:
    """Return the shortest time of a transfer next to a loop [s]."""
    return (size // (MAILBOX - OVERHEAD) + 1) * CYCLES_PER_PACKET * PERIOD


def measure(*, size: int, rounds: int, file: Path | None) -> None:
    """Measure all transfers in turn, and print the ratios.

    Args:
        size: Size of the file [bytes].
        rounds: Rounds in which the programs take turns.
        file: File for the figures.
    """
    need("pysoem")
    with served() as interface:
        found: dict[str, list[Transfer]] = {name: [] for name in WAYS}
        failed = dict.fromkeys(WAYS, 0)
        for _ in range(rounds):
            for name in WAYS:
                transfer, failures = repeated(name, interface, size)
                found[name].append(transfer)
                failed[name] += failures
    medians = {
        name: Transfer(name, size, statistics.median(each.seconds for each in transfers))
        for name, transfers in found.items()
    }
    quotients = ratios(medians)
    print(f"{machine()}\n{size} bytes in mailboxes of {MAILBOX} bytes, {rounds} rounds\n")
    for transfer in medians.values():
        print(f"  {transfer}")
    print(f"  {'bound next to a loop':20} {bound(size):7.3f} s\n")
    for name, quotient in quotients.items():
        print(f"  {name}: {quotient:.3f}")
    for name, count in failed.items():
        if count:
            print(f"  {name}: {count} transfers failed and were repeated")
    figures = [asdict(transfer) for transfers in found.values() for transfer in transfers]
    write_figures(
        file,
        {"machine": machine(), "ratios": quotients, "failed": failed, "transfers": figures},
    )


def ratios(medians: dict[str, Transfer]) -> dict[str, float]:
    """Return the rates relative to PySOEM on an idle bus, and to the bound next to a loop."""
    quotients = {}
    for way in ("read", "write"):
        own, other = medians[f"catenary-{way}"], medians[f"pysoem-{way}"]
        beside = medians[f"catenary-{way}-loop"]
        quotients[f"idle {way}: rate / PySOEM"] = other.seconds / own.seconds
        quotients[f"{way} next to a loop: rate / bound"] = bound(beside.size) / beside.seconds
    return {name: round(quotient, 3) for name, quotient in quotients.items()}


@contextmanager
def served() -> Iterator[str]:
    """Serve the segment, and yield the interface of the MainDevice."""
    cpu = processors().segment
    with veth_pair() as (ours, theirs):
        arguments = ["-m", "benchmarks.foe", "serve", theirs, "" if cpu is None else str(cpu)]
        with start_python(arguments) as server:
            if server.read_line(START_SECONDS) is None:
                raise LinkError("the segment of the benchmark did not start: see its message above")
            yield ours


def repeated(name: str, interface: str, size: int) -> tuple[Transfer, int]:
    """Run one transfer until it is complete. Return it, and the number of failed ones."""
    for failures in range(ATTEMPTS - 1):
        try:
            return once(name, interface, size), failures
        except CatenaryError as error:
            print(error, file=sys.stderr)
    return once(name, interface, size), ATTEMPTS - 1


def once(name: str, interface: str, size: int) -> Transfer:
    """Run one transfer in a new process."""
    with start_python(["-m", "benchmarks.foe", name, interface, str(size)]) as worker:
        line = worker.read_line(SECONDS)
    if line is None:
        raise CatenaryError(f"{name} did not transfer the file within {SECONDS:.0f} s")
    return msgspec.json.decode(line, type=Transfer)


def content(size: int) -> bytes:
    return bytes(k * 7 + k // 251 & 0xFF for k in range(size))


def timed(name: str, size: int, transfer: Callable[[], object]) -> Transfer:
    start = time.perf_counter()
    transfer()
    return Transfer(name, size, time.perf_counter() - start)


def idle(name: str, interface: str, size: int) -> Transfer:
    """Transfer a file with Catenary on an idle bus. It is written before it is read."""
    with cat.MainDevice(interface) as main:
        foe, data = main.scan()[POSITION].foe, content(size)
        written = timed(name, size, lambda: foe.write(NAME, data))
        if name == "catenary-write":
            return written
        return timed(name, size, lambda: checked(foe.read(NAME), data))


def beside_a_loop(name: str, interface: str, size: int) -> Transfer:
    """Transfer a file with Catenary while a loop runs in the background."""
    with cat.MainDevice(interface) as main:
        sub, data = main.scan()[POSITION], content(size)
        sub.foe.write(NAME, data)
        arm = cat.Drives([sub], counts_per_turn=2**20, velocity_limit=100.0)
        patience = cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT)
        with cat.Loop(arm, period=PERIOD, stop=patience) as loop:
            loop.run_in_background()
            if name == "catenary-write-loop":
                return timed(name, size, lambda: sub.foe.write(NAME, data))
            return timed(name, size, lambda: checked(sub.foe.read(NAME), data))


def with_pysoem(name: str, interface: str, size: int) -> Transfer:
    """Transfer a file with PySOEM. It is written before it is read."""
    import pysoem

    master = pysoem.Master()
    master.open(interface)
    try:
        if master.config_init() <= POSITION:
            raise CatenaryError("PySOEM did not find the device")
        if master.state_check(pysoem.PREOP_STATE, 5_000_000) != pysoem.PREOP_STATE:
            raise CatenaryError("PySOEM did not reach PRE-OP")
        slave: Any = master.slaves[POSITION]
        data = content(size)
        written = timed(name, size, lambda: accepted(slave.foe_write(NAME, 0, data, TIMEOUT_US)))
        if name == "pysoem-write":
            return written
        return timed(
            name, size, lambda: checked(bytes(slave.foe_read(NAME, 0, size, TIMEOUT_US)), data)
        )
    finally:
        master.close()


def accepted(result: int) -> None:
    """Raise CatenaryError if PySOEM returns the code of an error."""
    if result <= 0:
        raise CatenaryError(f"PySOEM did not write the file: it returned {result}")


def checked(found: bytes, expected: bytes) -> None:
    """Raise CatenaryError if a file differs from the written one."""
    if found != expected:
        raise CatenaryError(f"read {len(found)} bytes that differ from the {len(expected)} written")


WAYS: dict[str, Callable[[str, str, int], Transfer]] = {
    "catenary-read": idle,
    "pysoem-read": with_pysoem,
    "catenary-write": idle,
    "pysoem-write": with_pysoem,
    "catenary-read-loop": beside_a_loop,
    "catenary-write-loop": beside_a_loop,
}


def serve(interface: str, cpu: str) -> None:
    """Serve the segment in real time if permitted. It also answers late frames."""
    files = DeviceFiles(size_limit=1 << 26)
    servo = Servo(mailbox_bytes=MAILBOX, counts_per_turn=2**20, files=files)
    segment = Segment([Coupler(), servo], clock="monotonic")
    request_scheduling(priority=PRIORITY, cpu=int(cpu) if cpu else None)
    serve_segment(segment, interface, max_age=None, ready=partial(print, "ready", flush=True))


def main(arguments: Sequence[str]) -> None:
    if arguments[0] == "serve":
        serve(*arguments[1:])
        return
    name, interface, size = arguments
    print(msgspec.json.encode(WAYS[name](name, interface, int(size))).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
