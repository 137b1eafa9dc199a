"""`python -m benchmarks protocols`: delay of the cyclic send by each mailbox protocol.

One loop runs all the time. A thread uses one protocol after the other without a pause, each for one
window per round. The order rotates, so that slow changes of the machine affect all protocols alike.
The delay is the difference of the medians of `send`: wake-up to the last frame in the kernel.

`PROTOCOLS` has one row per protocol. A further protocol adds its row, and its device side to
`offered`. The loop is a new process: `python -m benchmarks.protocols run NIC JOB`. `serve NIC CPU
AXES` is the process of the segment.
"""

from __future__ import annotations

import gc
import os
import statistics
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np

import catenary as cat
from catenary.bench.loop import write as write_figures
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.bench.report import machine
from catenary.bench.segment import COUNTS_PER_TURN, PRIORITY, START_SECONDS, processors
from catenary.bus import SubDevice
from catenary.demo.server import serve_at_priority
from catenary.errors import CatenaryError, LinkError, ResponseTimeout
from catenary.realtime.child import start_python
from catenary.realtime.private_network import veth_pair
from catenary.realtime.system.scheduling import request_scheduling
from catenary.virtual import (
    Ads,
    Coupler,
    DeviceFiles,
    Ethernet,
    Segment,
    SercosDrive,
    Servo,
    VendorEcho,
)
from catenary.virtual.protocols import MailboxProtocol

POSITION, MAILBOX = 1, 1024  # of the device that serves the protocols
PERIOD_NS = 1_000_000
SETTLING = 100  # cycles after each change of the protocol, which are not measured
FILE, AREA, CONTENT = "file", 0x4020, bytes(range(256)) * 64
OBJECT, DESCRIBED = 0x2100, 0x1018
LIMIT_US = 1.0  # target for the delay of the median
ROUND_SECONDS = 60.0  # of a process in addition to its windows
FAILED_MAX = 100  # uses without an answer, because frames were lost


class Row(NamedTuple):
    """One protocol: its name, one use of it, and the position of the device."""

    name: str
    use: Callable[[SubDevice], object]
    position: int = POSITION


PROTOCOLS = (
    Row("SDO upload", lambda sub: sub.sdo.read(OBJECT)),
    Row("SDO information", lambda sub: sub.sdo.describe(DESCRIBED)),
    Row("FoE read", lambda sub: sub.foe.read(FILE)),
    Row("AoE read", lambda sub: sub.aoe.read(AREA, 0, len(CONTENT))),
    Row("VoE exchange", lambda sub: sub.voe.exchange(1, CONTENT[:1000])),
    Row("EoE address", lambda sub: sub.eoe.address()),
    Row("SoE read", lambda sub: sub.soe.read("S-0-0030"), position=-1),
)
NOTHING = "nothing"
NAMES = (NOTHING, *(row.name for row in PROTOCOLS))


def offered() -> tuple[MailboxProtocol, ...]:
    """Return the device side of the protocols beside CoE and FoE."""
    return Ads(areas={AREA: CONTENT}), VendorEcho(), Ethernet()


class Job(msgspec.Struct, frozen=True):
    """Parameters of one process."""

    rounds: int
    cycles: int  # of a window
    execution: Literal["inline", "threaded"]
    cpu: int | None


class Window(msgspec.Struct, frozen=True):
    """Figures of one protocol in one round."""

    name: str
    send_us: float  # median
    send_p99_us: float
    lateness_us: float  # median
    lost: int
    late: int
    uses: int  # of the protocol
    failed: int  # uses without an answer, because frames were lost
    cpu_us: float  # of the process, per cycle


class Found(msgspec.Struct, frozen=True):
    """Windows of one process, and its scheduling."""

    windows: list[Window]
    scheduling: str


def measure(
    *,
    axes: int,
    rounds: int,
    seconds: float,
    execution: Literal["inline", "threaded"],
    file: Path | None,
) -> None:
    """Measure all protocols, and print the delays.

    Args:
        axes: Number of axes of the loop.
        rounds: Rounds in which the protocols take turns.
        seconds: Time of a window [s].
        execution: Execution mode of the loop.
        file: File for the figures.
    """
    job = Job(rounds, round(seconds * 1e9 / PERIOD_NS), execution, processors().masters)
    with served(axes) as interface:
        found = once(interface, job)
    rows = summary(found.windows)
    print(f"{machine()}\n{axes} axes at 1 kHz, {execution}, {found.scheduling}")
    print(f"{rounds} rounds of {seconds:g} s per protocol\n")
    print(as_text(rows))
    setting = {"axes": axes, "rounds": rounds, "seconds": seconds, "execution": execution}
    figures = {"machine": machine(), "scheduling": found.scheduling, "setting": setting}
    windows = [msgspec.to_builtins(window) for window in found.windows]
    write_figures(file, {**figures, "protocols": rows, "windows": windows})


def summary(windows: Sequence[Window]) -> dict[str, dict[str, float]]:
    """Return the figures of each protocol over all rounds. `delay_us` is relative to `nothing`.

    The delay is the median of the differences within the rounds.
    """
    by_name: dict[str, list[Window]] = {name: [] for name in NAMES}
    for window in windows:
        by_name[window.name].append(window)
    idle = by_name[NOTHING]
    return {name: _row(each, idle) for name, each in by_name.items() if each}


def _row(windows: Sequence[Window], idle: Sequence[Window]) -> dict[str, float]:
    delays = [one.send_us - other.send_us for one, other in zip(windows, idle, strict=True)]
    median = statistics.median
    return {
        "send_us": round(median(each.send_us for each in windows), 3),
        "delay_us": round(median(delays), 3),
        "send_p99_us": round(median(each.send_p99_us for each in windows), 3),
        "lateness_us": round(median(each.lateness_us for each in windows), 3),
        "lost": sum(each.lost for each in windows),
        "late": sum(each.late for each in windows),
        "uses": sum(each.uses for each in windows),
        "failed": sum(each.failed for each in windows),
        "cpu_us": round(median(each.cpu_us for each in windows), 2),
    }


def as_text(rows: Mapping[str, Mapping[str, float]]) -> str:
    """Return the figures as a table, and the protocols that miss the target."""
    columns = ("send_us", "delay_us", "send_p99_us", "lateness_us", "cpu_us")
    counts = ("lost", "late", "uses", "failed")
    lines = [f"{'':18}" + "".join(f"{name:>13}" for name in (*columns, *counts))]
    for name, row in rows.items():
        figures = "".join(f"{row[column]:13.2f}" for column in columns)
        lines.append(f"{name:18}{figures}" + "".join(f"{row[each]:13.0f}" for each in counts))
    slow = [name for name, row in rows.items() if row["delay_us"] > LIMIT_US]
    unused = [name for name, row in rows.items() if name != NOTHING and not row["uses"]]
    verdict = f"above: {', '.join(slow)}" if slow else "all protocols reach it"
    if unused:
        verdict = f"{verdict}; without a completed use: {', '.join(unused)}"
    return "\n".join(
        [*lines, f"\ntarget: the median is delayed by at most {LIMIT_US} us: {verdict}"]
    )


@contextmanager
def served(axes: int) -> Iterator[str]:
    """Serve the segment, and yield the interface of the MainDevice."""
    cpu = processors().segment
    with veth_pair() as (ours, theirs):
        arguments = ["serve", theirs, "" if cpu is None else str(cpu), str(axes)]
        with start_python(["-m", "benchmarks.protocols", *arguments]) as server:
            if server.read_line(START_SECONDS) is None:
                raise LinkError("the segment of the benchmark did not start: see its message above")
            yield ours


def once(interface: str, job: Job) -> Found:
    """Run the loop in a new process."""
    cycles = job.rounds * len(NAMES) * (job.cycles + SETTLING)
    limit = 2 * cycles * PERIOD_NS * 1e-9 + ROUND_SECONDS
    text = msgspec.json.encode(job).decode()
    with start_python(["-m", "benchmarks.protocols", "run", interface, text]) as worker:
        line = worker.read_line(limit)
    if line is None:
        raise CatenaryError(f"the loop did not end within {limit:.0f} s: see its message above")
    return msgspec.json.decode(line, type=Found)


class User:
    """Thread that uses one protocol without a pause. It owns the counts of the uses."""

    def __init__(self, subs: Sequence[SubDevice]) -> None:
        self._subs = subs
        self._row: Row | None = None
        self._ended = threading.Event()
        self.uses = self.failed = 0
        self.error: CatenaryError | None = None
        self._thread = threading.Thread(target=self._run, name="protocol", daemon=True)

    def __enter__(self) -> User:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def choose(self, name: str) -> None:
        """Use another protocol from the next use on; `nothing` pauses."""
        self._row = {row.name: row for row in PROTOCOLS}.get(name)

    def _run(self) -> None:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # not that of the loop
        while not self._ended.is_set():
            row = self._row
            if row is None:
                time.sleep(1e-3)
                continue
            try:
                row.use(self._subs[row.position])
                self.uses += 1
            except CatenaryError as error:
                if self._ended.is_set():
                    return  # the loop has ended during the use
                self.failed += 1
                if not isinstance(error, ResponseTimeout) or self.failed > FAILED_MAX:
                    self.error = error
                    return


def run(interface: str, job: Job) -> Found:
    """Run the loop and return its windows."""
    scheduling = request_scheduling(priority=PRIORITY, lock_memory=True, cpu=job.cpu)
    with cat.MainDevice(interface) as main:
        subs = main.scan()
        subs[POSITION].foe.write(FILE, CONTENT)
        arm = cat.Drives(subs[POSITION:-1], counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0)
        gc.collect()
        gc.freeze()
        with (
            cat.Loop(
                arm,
                period=PERIOD_NS * 1e-9,
                execution=job.execution,
                cpu=job.cpu,
                priority=PRIORITY,
                stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
                log=job.cycles + 2,
            ) as loop,
            User(subs) as user,
        ):
            windows = [
                _window(loop, user, name, job.cycles)
                for number in range(job.rounds)
                for name in _rotated(number)
            ]
    return Found(windows, str(scheduling))


def _rotated(number: int) -> tuple[str, ...]:
    place = number % len(NAMES)
    return NAMES[place:] + NAMES[:place]


def _window(loop: cat.Loop, user: User, name: str, cycles: int) -> Window:
    """Use a protocol for the cycles of one window, and return its figures."""
    user.choose(name)
    before, uses, failed, cpu = dict(loop.timing.counters), 0, 0, 0
    for number, _cycle in enumerate(loop):
        if user.error is not None:
            raise user.error
        if number == SETTLING:
            before, cpu = dict(loop.timing.counters), time.process_time_ns()
            uses, failed = user.uses, user.failed
        elif number == SETTLING + cycles:
            break
    cpu, after = time.process_time_ns() - cpu, loop.timing.counters
    log = loop.log[-cycles - 1 : -1]  # the last cycle is incomplete
    send = np.asarray(log["send_ns"], dtype=np.int64) * 1e-3
    return Window(
        name,
        send_us=float(np.median(send)),
        send_p99_us=float(np.quantile(send, 0.99)),
        lateness_us=float(np.median(np.asarray(log["lateness_ns"], dtype=np.int64))) * 1e-3,
        lost=after["lost"] - before["lost"],
        late=after["late"] - before["late"],
        uses=user.uses - uses,
        failed=user.failed - failed,
        cpu_us=cpu / cycles * 1e-3,
    )


def serve(interface: str, cpu: str, axes: str) -> None:
    files = DeviceFiles(size_limit=1 << 20)
    first = Servo(
        mailbox_bytes=MAILBOX, counts_per_turn=COUNTS_PER_TURN, files=files, protocols=offered()
    )
    others = [Servo(counts_per_turn=COUNTS_PER_TURN) for _ in range(int(axes) - 1)]
    segment = Segment([Coupler(), first, *others, SercosDrive()], clock="monotonic")
    serve_at_priority(segment, interface, PRIORITY, second=None, cpu=int(cpu) if cpu else None)


def main(arguments: Sequence[str]) -> None:
    command, interface, *rest = arguments
    if command == "serve":
        serve(interface, *rest)
        return
    found = run(interface, msgspec.json.decode(rest[0], type=Job))
    print(msgspec.json.encode(found).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
