# The table `igh`, run inside the guest. The module of the IgH master is at one end of a pair of
# interfaces, and a virtual segment at the other. Our loops run over the module. Like guest.py, this
# file imports nothing from its folder. The exit status is 1 if a frame was lost.
from __future__ import annotations

import contextlib
import ctypes
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Container, Iterator, Sequence
from pathlib import Path
from typing import Any

import catenary as cat
from catenary.bench.law_loop import sine
from catenary.bench.segment import COUNTS_PER_TURN, PRIORITY, served
from catenary.errors import CatenaryError, ConfigurationError, NoDeviceError

FOLDER = Path("/igh")
INIT_MODULE, DELETE_MODULE = 175, 176  # system calls, x86-64
DRIVES = 3
CYCLES = {1000: 4002, 4000: 12_000}  # by rate [Hz]
WAYS = ("threaded", "inline", "law")
CASES = (*itertools.product((None, "reference"), WAYS), ("main", "threaded"))  # clock, way
# The bring-up of the module leaves three periods (750 us) without new outputs: the drives fault
# (0x8700).
LEFT_OUT = (4000, "reference", "inline")
WARM_UP = 1.5  # [s] after which no frame may be lost; the module logs its bring-up for up to 1 s
AMPLITUDE = 0.1  # [rad]
NEVER = 1e9  # [s]
NODE = Path("/dev/EtherCAT0")
SETTLE_SECONDS = 10.0
CHANGES = "orking counter change"  # in the log, for frames that the module missed
LINES = 20  # lines of the kernel's log after a failure


@contextlib.contextmanager
def master_on(*interfaces: str) -> Iterator[None]:
    """Load the module on one interface, or on both ends of a ring."""
    roles = ("main_devices", "backup_devices")
    addresses = (Path(f"/sys/class/net/{name}/address").read_text().strip() for name in interfaces)
    load("ec_master", " ".join(map("=".join, zip(roles, addresses, strict=False))))
    load("ec_generic")
    try:
        wait_for(NODE.exists)
        yield
    finally:
        unload("ec_generic")
        unload("ec_master")


def wait_for(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + SETTLE_SECONDS
    while not done() and time.monotonic() < deadline:
        time.sleep(0.01)


def load(name: str, parameters: str = "") -> None:
    content = (FOLDER / f"{name}.ko").read_bytes()
    call(name, INIT_MODULE, content, len(content), parameters.encode())


def unload(name: str) -> None:
    call(name, DELETE_MODULE, name.encode(), os.O_NONBLOCK)


def call(what: str, *arguments: int | bytes) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(*arguments) != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


class Log:
    """Owns a position in the kernel's log."""

    def __init__(self) -> None:
        self._file = os.open("/dev/kmsg", os.O_RDONLY | os.O_NONBLOCK)
        os.lseek(self._file, 0, os.SEEK_END)

    def lines(self) -> Iterator[str]:
        """Return the lines that the master has logged since the last call."""
        with contextlib.suppress(BlockingIOError):
            while record := os.read(self._file, 8192):
                text = record.decode(errors="replace").partition(";")[2].splitlines()[0]
                if "EtherCAT" in text:
                    yield text


def run(found: dict[str, Any], way: str, rate: int, clock: str | None) -> None:
    """Add the results of one loop to `found`, after its warm-up."""
    with cat.MainDevice("igh:0") as main:
        arm = cat.Drives(
            main.scan().drives,
            counts_per_turn=COUNTS_PER_TURN,
            velocity_limit=100.0,
            dc=clock is not None,
        )
        clocks = cat.ClockOptions(lead=clock)
        with cat.Loop(
            arm,
            period=1 / rate,
            execution="inline" if way == "inline" else "threaded",
            scheduling=cat.Scheduling(
                switch_interval=20e-6 if way == "inline" else None
            ),  # docs/explanation/benchmarks.md
            priority=PRIORITY,
            stop=cat.StopPolicy(lost_limit=1000, late_limit=10.0),
            laws=[sine] if way == "law" else [],
            clocks=clocks,
        ) as loop:
            if way == "law":
                home = arm.actual.position.copy()
                loop.start(sine, memory=home, parameters=[AMPLITUDE, 0.0, 0.0, NEVER])
            found |= measure(loop, way, rate, clock)


def cycle(loop: cat.Loop, cycles: int, rate: int, law: bool) -> None:
    """Exchange a number of cycles. With a law, this thread only waits."""
    if not law:
        first = next(loop).number
        while next(loop).number < first + cycles:
            pass  # do not read the counters: it takes over 250 us and would delay an inline loop
        return
    last = loop.timing.counters["cycles"] + cycles
    while loop.timing.counters["cycles"] < last:
        time.sleep(100 / rate)
        next(loop)


def measure(loop: cat.Loop, way: str, rate: int, clock: str | None) -> dict[str, Any]:
    cycle(loop, round(WARM_UP * rate), rate, way == "law")
    log, before = Log(), loop.timing.counters
    if clock is not None:
        loop.clocks.reset()
    cycle(loop, CYCLES[rate], rate, way == "law")
    after = loop.timing.counters
    counted = ("cycles", "lost", "late")
    found: dict[str, Any] = {name: after[name] - before[name] for name in counted}
    found["log"] = [line for line in log.lines() if CHANGES in line]
    return found | ({} if clock is None else figures_of(loop.clocks))


def figures_of(clocks: Any) -> dict[str, Any]:
    differences = clocks.largest_differences
    return {
        "locked": clocks.locked,
        "jumps": clocks.jumps,
        "missed": clocks.missed,
        "phase_error_us": round(clocks.largest_phase_error * 1e6, 3),
        "differences_us": {device: round(d * 1e6, 3) for device, d in differences.items()},
    }


def rings() -> Iterator[dict[str, Any]]:
    """Run a loop without clocks in a closed ring, and check that one with clocks is refused."""
    found: dict[str, Any] = {"rate": 1000, "way": "threaded", "clock": "none, closed ring"}
    with (
        served(DRIVES, ring=True) as segment,
        master_on(segment.interface, segment.second),
        attempt(found),
    ):
        try:
            run(found, "threaded", 1000, None)
            run({}, "threaded", 1000, "reference")
            found["error"] = "clocks in a closed ring were not refused"
        except ConfigurationError as refusal:
            found["refused"] = str(refusal)
        except NoDeviceError:
            found["left_out"] = "no device found: is the module built for one interface?"
    yield found


def line(rate: int, way: str, clock: str | None) -> dict[str, Any]:
    found = {"rate": rate, "way": way, "clock": clock or "none"}
    with attempt(found):
        run(found, way, rate, clock)
    return found


@contextlib.contextmanager
def attempt(found: dict[str, Any]) -> Iterator[None]:
    """Add an error of the block and the log of the module to `found`."""
    log = Log()
    try:
        yield
    except CatenaryError as error:
        found["error"], found["notes"] = str(error), getattr(error, "__notes__", [])
        found["log"] = list(log.lines())[-LINES:]


def lines(chosen: Container[str]) -> Iterator[dict[str, Any]]:
    with served(DRIVES) as segment, master_on(segment.interface):
        for rate, (clock, way) in itertools.product(CYCLES, CASES):
            if str(rate) in chosen and way in chosen and (rate, clock, way) != LEFT_OUT:
                yield line(rate, way, clock)


def sound(found: dict[str, Any]) -> bool:
    healthy = not found.get("error") and not found.get("lost") and not found.get("log")
    return bool(healthy and found.get("locked", True) and not found.get("jumps"))


def main(arguments: Sequence[str]) -> int:
    """Run all loops, or those chosen by the arguments before the file: rates, ways, `ring`."""
    *words, _json, file = arguments
    chosen = set(words) or {*map(str, CYCLES), *WAYS, "ring"}
    table = []
    rows = lines(chosen) if chosen & {*map(str, CYCLES)} else ()
    for found in itertools.chain(rows, rings() if "ring" in chosen else ()):
        print(json.dumps(found), flush=True)
        table.append(found)
    Path(file).write_text(json.dumps({"runs": table}))
    return 0 if all(map(sound, table)) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
