# The table `igh`, run inside the guest: the module of the IgH master on one end of a pair of
# interfaces, a virtual segment on the other, and our loops over it. It stands alone, as guest.py
# does: of this folder the guest has only these two. Ends with status 1 if anything was lost.
from __future__ import annotations

import contextlib
import ctypes
import itertools
import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import catenary as cat
from catenary.bench.peers.with_catenary_law import sine
from catenary.bench.segment import COUNTS_PER_TURN, PRIORITY, served
from catenary.errors import CatenaryError

FOLDER = Path("/igh")
INIT_MODULE = 175  # the system call, x86-64
DRIVES = 3
CYCLES = {1000: 4002, 4000: 12_000}  # by rate [Hz]
WAYS = ("threaded", "inline", "law")
CASES = (*itertools.product((None, "reference"), WAYS), ("main", "threaded"))  # clock, way
WARM_UP = 1.5  # [s]: after it nothing may be lost; the module logs its bring-up for up to 1 s
AMPLITUDE = 0.1  # [rad]
NEVER = 1e9  # [s]
NODE = Path("/dev/EtherCAT0")
SETTLE_SECONDS = 10.0
CHANGES = "orking counter change"  # in lines of the log: of frames that the module missed
LINES = 20  # of the kernel's log, where a loop failed


def load(name: str, parameters: str = "") -> None:
    content = (FOLDER / f"{name}.ko").read_bytes()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(INIT_MODULE, content, len(content), parameters.encode()) != 0:
        raise OSError(ctypes.get_errno(), f"{name}: {os.strerror(ctypes.get_errno())}")


class Log:
    """Owns a place in the kernel's log."""

    def __init__(self) -> None:
        self._file = os.open("/dev/kmsg", os.O_RDONLY | os.O_NONBLOCK)
        os.lseek(self._file, 0, os.SEEK_END)

    def lines(self) -> Iterator[str]:
        """Return what the master has logged since."""
        with contextlib.suppress(BlockingIOError):
            while record := os.read(self._file, 8192):
                text = record.decode(errors="replace").partition(";")[2].splitlines()[0]
                if "EtherCAT" in text:
                    yield text


def run(way: str, rate: int, clock: str | None) -> dict[str, Any]:
    """Return what one loop did, after it has warmed up."""
    with cat.MainDevice("igh:0") as main:
        arm = cat.Drives(
            main.scan().drives,
            counts_per_turn=COUNTS_PER_TURN,
            velocity_limit=100.0,
            dc=clock is not None,
        )
        options: dict[str, Any] = {} if clock is None else {"clock": clock}
        with cat.Loop(
            arm,
            period=1 / rate,
            run="inline" if way == "inline" else "threaded",
            priority=PRIORITY,
            lost_limit=1000,
            late_limit=10.0,
            laws=[sine] if way == "law" else [],
            **options,
        ) as loop:
            if way == "law":
                home = arm.actual.position.copy()
                loop.start(sine, memory=home, parameters=[AMPLITUDE, 0.0, 0.0, NEVER])
            return measure(loop, way, rate, clock)


def cycle(loop: cat.Loop, count: int, rate: int, law: bool) -> None:
    """Exchange cycles until there were so many. A law needs no thread meanwhile."""
    while loop.timing.counters["cycles"] < count:
        if law:
            time.sleep(100 / rate)
        next(loop)


def measure(loop: cat.Loop, way: str, rate: int, clock: str | None) -> dict[str, Any]:
    cycle(loop, loop.timing.counters["cycles"] + round(WARM_UP * rate), rate, way == "law")
    log, before = Log(), loop.timing.counters
    if clock is not None:
        loop.clocks.reset()
    cycle(loop, before["cycles"] + CYCLES[rate], rate, way == "law")
    after = loop.timing.counters
    found = {name: after[name] - before[name] for name in ("cycles", "lost", "late")}
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


def sound(found: dict[str, Any]) -> bool:
    healthy = not found.get("error") and not found.get("lost") and not found.get("log")
    return bool(healthy and found.get("locked", True) and not found.get("jumps"))


def main(file: Path) -> int:
    table = []
    with served(DRIVES) as segment:
        address = Path(f"/sys/class/net/{segment.interface}/address").read_text().strip()
        load("ec_master", f"main_devices={address}")
        load("ec_generic")
        deadline = time.monotonic() + SETTLE_SECONDS
        while not NODE.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        for rate, (clock, way) in itertools.product(CYCLES, CASES):
            name, log = {"rate": rate, "way": way, "clock": clock or "none"}, Log()
            try:
                found = name | run(way, rate, clock)
            except CatenaryError as error:
                notes, said = getattr(error, "__notes__", []), list(log.lines())
                found = name | {"error": str(error), "notes": notes, "log": said[-LINES:]}
            print(json.dumps(found), flush=True)
            table.append(found)
    file.write_text(json.dumps({"runs": table}))
    return 0 if all(map(sound, table)) else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[-1])))
