"""`python -m benchmarks eoe`: a web page of a device through EoE, next to 33 axes at 1 kHz.

The loop runs without and with the transfer in turn. The rate is compared with a bound: each cycle
carries one fragment from the device, and a full Ethernet frame of 1514 bytes with 1460 bytes of TCP
data has two fragments in mailboxes of 1024 bytes.

Each run is a new process: `python -m benchmarks.eoe NAME NIC SECONDS`. `serve NIC CPU` is the
process of the segment.
"""

from __future__ import annotations

import statistics
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec

import catenary as cat
from catenary.bench.loop import write as write_figures
from catenary.bench.report import machine
from catenary.bench.segment import PRIORITY, START_SECONDS, processors
from catenary.demo.server import serve_at_priority
from catenary.errors import CatenaryError, LinkError
from catenary.realtime.child import start_python
from catenary.realtime.private_network import run_ip, veth_pair
from catenary.virtual import Coupler, Ethernet, Segment, Servo
from catenary.wire.eoe_frames import fragments_of
from catenary.wire.mailbox import HEADER_SIZE

DRIVES, MAILBOX, PERIOD = 33, 1024, 1e-3
FRAME, DATA = 1514, 1460  # [bytes] of a full Ethernet frame, and of TCP data in it
TAP, OWN_IP, IP = "cateoe0", "192.168.7.1/24", "192.168.7.2"
PAGE = "".join(f"{k:07d}\n" for k in range(50_000))  # 400 kB
LOST_LIMIT = 1000  # lost cycles in a row: the runs are counted, not stopped
LIMIT = 60.0  # [s] for one process beyond its run time
WAYS = "without", "with"


@dataclass(frozen=True, slots=True)
class Run:
    """Result of one run."""

    name: str
    seconds: float
    cycles: int
    lost: int
    late: int
    bytes: int  # of complete pages

    @property
    def kilobytes_per_second(self) -> float:
        return self.bytes / self.seconds * 1e-3

    def __str__(self) -> str:
        return (
            f"{self.name:8} {self.cycles:8} cycles, {self.lost} lost, {self.late} late, "
            f"{self.kilobytes_per_second:6.0f} kB/s"
        )


def bound() -> float:
    """Return the largest rate of TCP data [kB/s]."""
    fragments = len(fragments_of(bytes(FRAME), 0, MAILBOX - HEADER_SIZE))
    return DATA / (fragments * PERIOD) * 1e-3


def measure(*, seconds: float, rounds: int, file: Path | None) -> None:
    """Measure the runs in turn, and print the rate and the lost cycles.

    Args:
        seconds: Run time of every run [s].
        rounds: Rounds in which the runs take turns.
        file: File for the figures.
    """
    with served() as interface:
        runs = [once(name, interface, seconds) for _ in range(rounds) for name in WAYS]
    rate = statistics.median(run.kilobytes_per_second for run in runs if run.name == "with")
    lost = {name: sum(run.lost for run in runs if run.name == name) for name in WAYS}
    quotients = {"rate / bound": round(rate / bound(), 3)}
    print(f"{machine()}\n{DRIVES} drives, mailboxes of {MAILBOX} bytes, {rounds} rounds\n")
    for run in runs:
        print(f"  {run}")
    print(f"  bound {bound():.0f} kB/s, {quotients}, lost cycles {lost}")
    figures = [asdict(run) for run in runs]
    write_figures(
        file, {"machine": machine(), "bound": bound(), "ratios": quotients, "runs": figures}
    )


@contextmanager
def served() -> Iterator[str]:
    """Create the TAP, serve the segment, and yield the interface of the MainDevice."""
    cpu = processors().segment
    with veth_pair() as (ours, theirs):
        run_ip("tuntap", "add", "dev", TAP, "mode", "tap")
        try:
            run_ip("address", "add", OWN_IP, "dev", TAP)
            run_ip("link", "set", TAP, "up")
            arguments = ["-m", "benchmarks.eoe", "serve", theirs, "" if cpu is None else str(cpu)]
            with start_python(arguments) as server:
                if server.read_line(START_SECONDS) is None:
                    raise LinkError("the segment of the benchmark did not start: see above")
                yield ours
        finally:
            run_ip("tuntap", "del", "dev", TAP, "mode", "tap")


def once(name: str, interface: str, seconds: float) -> Run:
    """Make one run in a new process."""
    with start_python(["-m", "benchmarks.eoe", name, interface, str(seconds)]) as worker:
        line = worker.read_line(seconds + LIMIT)
    if line is None:
        raise CatenaryError(f"the run {name!r} did not end")
    return msgspec.json.decode(line, type=Run)


def run(name: str, interface: str, seconds: float) -> Run:
    """Run the loop, and with "with" fetch the page again and again."""
    with cat.MainDevice(interface) as main:
        drives = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with (
            main.subs[1].eoe.connect(TAP),
            cat.Loop(drives, period=PERIOD, stop=cat.StopPolicy(lost_limit=LOST_LIMIT)) as loop,
        ):
            loop.run_in_background()
            start, received = time.monotonic(), 0
            while time.monotonic() - start < seconds:
                if name == "with":
                    received += fetched()
                else:
                    time.sleep(0.01)
            passed = time.monotonic() - start
            counters = loop.timing.counters
            return Run(
                name, passed, counters["cycles"], counters["lost"], counters["late"], received
            )


def fetched() -> int:
    """Fetch the page, and return its size. Raises CatenaryError if it differs."""
    with urllib.request.urlopen(f"http://{IP}/", timeout=LIMIT) as answer:
        page = answer.read()
    if page != PAGE.encode():
        raise CatenaryError(f"the page of {len(page)} bytes differs from that of the device")
    return len(page)


def serve(interface: str, cpu: str) -> None:
    ethernet = Ethernet(pages={"/": PAGE})
    first = Servo(mailbox_bytes=MAILBOX, counts_per_turn=2**20, protocols=[ethernet])
    others = [Servo(counts_per_turn=2**20) for _ in range(DRIVES - 1)]
    segment = Segment([Coupler(), first, *others], clock="monotonic")
    serve_at_priority(segment, interface, PRIORITY, second=None, cpu=int(cpu) if cpu else None)


def main(arguments: Sequence[str]) -> None:
    if arguments[0] == "serve":
        serve(*arguments[1:])
        return
    name, interface, seconds = arguments
    print(msgspec.json.encode(run(name, interface, float(seconds))).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
