"""`python -m benchmarks.sensors`: an inertial sensor at 500 Hz next to a loop at 1 kHz.

Three processes: a simulated device at a pseudo terminal, the program of the sensor, and a loop with
a virtual segment in real time. The body of the loop reads the sensor in every cycle. With
`--priority 60`, all three have this SCHED_FIFO priority, as with `chrt -f 60`.

The times to reception contain the lateness of the simulated device. The smallest delay counts as 0,
because the clock of the device is mapped by it.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

import catenary as cat
from catenary import sensors
from catenary.bench.report import machine
from catenary.bench.segment import COUNTS_PER_TURN, make_segment
from catenary.errors import ShareError

RATE = 500.0  # [Hz] of the sensor
PERIOD = 1e-3  # [s] of the loop
DRIVES = 3
START_SECONDS = 20.0
DRAIN_SECONDS = 0.3  # the terminal keeps its last bytes until the program has read them
DEVICE_START_NS = 123_456_789_000  # zero of the clock of the device, on CLOCK_MONOTONIC
NS = 1_000_000_000
Times = npt.NDArray[np.float64]


def device(_: str) -> None:
    """Simulate a device: write MIP packets to a pseudo terminal until SIGTERM."""
    stop = stop_at_signal()
    master, slave = os.openpty()
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    os.read(master, 4096)  # the first message of the program of the sensor
    sent, begin = 0, time.monotonic_ns()
    while not stop.is_set():
        due = begin + round(sent * NS / RATE)
        time.sleep(max(due - time.monotonic_ns(), 0) / NS)
        os.write(master, packet(due - DEVICE_START_NS))
        sent += 1
    time.sleep(DRAIN_SECONDS)
    print(json.dumps({"sent": sent}), flush=True)


def packet(time_ns: int) -> bytes:
    """Return a MIP packet with the reference time, an acceleration and an angular velocity."""
    vector = struct.pack(">3f", 0.0, 0.0, 1.0)
    body = struct.pack(">BBQ", 10, 0xD5, time_ns) + b"\x0e\x04" + vector + b"\x0e\x05" + vector
    message = struct.pack("BBBB", 0x75, 0x65, 0x80, len(body)) + body
    first = second = 0
    for byte in message:
        first = (first + byte) & 0xFF
        second = (second + first) & 0xFF
    return message + bytes((first, second))


def sensor(port: str) -> None:
    """Run the sensor until SIGTERM."""
    stop = stop_at_signal()
    imu = sensors.Mip(["acceleration", "angular_velocity"], rate=RATE)
    with sensors.SensorShare(share_name(), imu.channels, imu.rate, history=60.0) as share:
        sensors.run(imu, sensors.SerialPort(port), share, stop=stop)
    print(json.dumps(imu.counters.as_dict()), flush=True)


def share_name() -> str:
    return f"bench-imu-{os.environ['CATENARY_BENCH']}"


def stop_at_signal() -> threading.Event:
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    return stop


@contextmanager
def role(name: str, argument: str = "") -> Iterator[subprocess.Popen[str]]:
    """Run this file in another role; end it at the end of the block."""
    command = [sys.executable, "-m", "benchmarks.sensors", "--role", name, "--argument", argument]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def last_line(process: subprocess.Popen[str]) -> dict[str, int]:
    """Stop a role, and return its counts."""
    process.terminate()
    output, _ = process.communicate(timeout=START_SECONDS)
    counts: dict[str, int] = json.loads(output.splitlines()[-1])
    return counts


def measure(seconds: float) -> dict[str, object]:
    """Return the figures of one run.

    Args:
        seconds: duration [s].
    """
    os.environ["CATENARY_BENCH"] = str(os.getpid())
    with role("device") as imu:
        assert imu.stdout is not None
        with role("sensor", imu.stdout.readline().strip()) as program, attached() as reader:
            ages, reads, invalid, lost = run_loop(reader, seconds)
            with cat.attach(share_name()) as share:
                rows, _ = share.rows(0)
            sent = last_line(imu)["sent"]
            counters = last_line(program)
    rows = rows[rows["valid"] == 1][int(RATE) // 2 :]  # without the start
    delay = (rows["received_ns"] - rows["scheduled_ns"]) * 1e-3
    duration = (rows["scheduled_ns"][-1] - rows["scheduled_ns"][0]) * 1e-9
    return {
        "machine": machine(),
        "load_average": os.getloadavg()[0],  # of all programs, over the last minute
        "seconds": seconds,
        "priority": os.sched_getparam(0).sched_priority,  # 0: ordinary scheduling
        "loop": {"rate_hz": 1 / PERIOD, "drives": DRIVES, "cycles": len(ages), **lost},
        "samples_sent": sent,
        "rate_hz": round((len(rows) - 1) / duration, 3),
        "time_to_reception_us": figures(delay),
        "age_in_body_us": figures(ages * 1e6),
        "read_us": figures(reads * 1e6),
        "invalid_readings": invalid,
        "counters": counters,
    }


@contextmanager
def attached() -> Iterator[sensors.SensorReader]:
    """Wait for the sensor, and attach to it."""
    until = time.monotonic() + START_SECONDS
    while True:
        try:
            reader = sensors.attach(share_name())
            break
        except ShareError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)
    with reader:
        while not reader.read().valid and time.monotonic() < until:
            reader.wait(0.1)
        yield reader


def run_loop(
    reader: sensors.SensorReader, seconds: float
) -> tuple[Times, Times, int, dict[str, int]]:
    """Run the loop. Return ages and times to read [s], invalid readings, and lost cycles.

    Args:
        reader: reader of the sensor.
        seconds: duration [s].
    """
    ages, reads, invalid = [], [], 0
    with cat.MainDevice(make_segment(DRIVES)) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0)
        with cat.Loop(arm, period=PERIOD) as loop:
            for cycle in loop:
                begin = time.perf_counter()
                now = reader.read()
                reads.append(time.perf_counter() - begin)
                ages.append(now.age)
                invalid += not now.valid
                if cycle.time > seconds:
                    break
            counters = loop.timing.counters
    lost = {name: counters[name] for name in ("lost", "late")}
    return np.array(ages), np.array(reads), invalid, lost


def figures(values: Times) -> dict[str, float]:
    """Return p50, p99 and the maximum."""
    p50, p99, high = (round(float(np.percentile(values, q)), 1) for q in (50, 99, 100))
    return {"p50": p50, "p99": p99, "max": high}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--priority", type=int, default=0, help="SCHED_FIFO; 0: ordinary")
    parser.add_argument("--role", choices=["device", "sensor"], help=argparse.SUPPRESS)
    parser.add_argument("--argument", default="", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.role:
        {"device": device, "sensor": sensor}[given.role](given.argument)
        return
    if given.priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(given.priority))
    text = json.dumps(measure(given.seconds), indent=2, ensure_ascii=False)
    print(text)
    if given.json is not None:
        given.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
