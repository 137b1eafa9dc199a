# The table `gpio`, run inside the guest: reaction of a waiting program to the edge of a line. A
# process of lower priority changes a line of the kernel's GPIO simulator. Like guest.py, this file
# imports nothing from its folder. The exit status is 1 if an edge was lost.
from __future__ import annotations

import contextlib
import ctypes
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from catenary.bench.statistics import summarise
from catenary.sensors.gpio import GpioEdges, GpioLines, GpioOutput

FOLDER = Path("/gpio")
CONFIGFS = Path("/sys/kernel/config")
INIT_MODULE = 175  # system call, x86-64
INPUT, OUTPUT, LINES = 1, 2, 4
PRIORITY, BELOW = 80, 10  # of the waiting program; the source of edges is lower by BELOW
EVENTS, PERIOD = 2000, 1e-3  # [s]
TIME_OUT = 5.0  # [s]


def load(libc: ctypes.CDLL, name: str) -> None:
    content = (FOLDER / f"{name}.ko").read_bytes()
    if libc.syscall(INIT_MODULE, content, len(content), b"") != 0:
        raise OSError(ctypes.get_errno(), f"module {name}")


@contextlib.contextmanager
def simulator() -> Iterator[tuple[str, Path]]:
    """Create a chip. Yield its path, and the folder of its lines."""
    libc = ctypes.CDLL(None, use_errno=True)
    load(libc, "configfs")
    if libc.mount(b"configfs", str(CONFIGFS).encode(), b"configfs", 0, None) != 0:
        raise OSError(ctypes.get_errno(), "mount configfs")
    load(libc, "gpio-sim")
    device = CONFIGFS / "gpio-sim" / "rtlab"
    bank = device / "bank0"
    bank.mkdir(parents=True)
    (bank / "num_lines").write_text(str(LINES))
    (device / "live").write_text("1")
    name, chip = (device / "dev_name").read_text(), (bank / "chip_name").read_text()
    yield f"/dev/{chip.strip()}", Path("/sys/devices/platform", name.strip(), chip.strip())
    (device / "live").write_text("0")


def make_edges(pull: Path) -> None:
    """Change the input once per period. Run as the child of the waiting program."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY - BELOW))
    with pull.open("wb", buffering=0) as file:
        for number in range(EVENTS):
            time.sleep(PERIOD)
            os.pwrite(file.fileno(), b"pull-down" if number % 2 else b"pull-up", 0)


def measure(chip: str, lines: Path) -> tuple[GpioEdges, dict[str, list[int]]]:
    """Return the decoder, and the times from each edge to the program and to its output [ns]."""
    edges = GpioEdges({"input": INPUT})
    found: dict[str, list[int]] = {"edge to running": [], "edge to output": []}
    connection = GpioLines(chip, edges.lines).open()
    with GpioOutput(chip, OUTPUT) as output:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        if (child := os.fork()) == 0:
            make_edges(lines / f"sim_gpio{INPUT}" / "pull")
            os._exit(0)
        while edges.counters.samples < EVENTS:
            data, received_ns = connection.read(TIME_OUT)
            for sample in edges.feed(data, received_ns):
                output.write(bool(sample.values["input"]))
                found["edge to running"].append(received_ns - (sample.time_ns or 0))
                found["edge to output"].append(time.monotonic_ns() - (sample.time_ns or 0))
            if not data:
                break
        os.waitpid(child, 0)
    connection.close()
    return edges, found


def main(arguments: Sequence[str]) -> int:
    """Run the table, and write it to the last argument."""
    with simulator() as (chip, lines):
        edges, found = measure(chip, lines)
    missing = EVENTS - edges.counters.samples
    ways = [
        {
            "way": way,
            "events": len(times),
            "missing": missing,
            "reaction_us": summarise(np.array(times, np.float64) * 1e-3),
        }
        for way, times in found.items()
    ]
    for each in ways:
        print(json.dumps(each), flush=True)
    Path(arguments[-1]).write_text(json.dumps({"period": PERIOD, "ways": ways}))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
