"""Edges of GPIO lines: the kernel's events, and lines of its simulator where it has one."""

from __future__ import annotations

import errno
import os
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.sensors.gpio import GpioConnection, GpioEdges, GpioLines, GpioOutput

RISING, FALLING = 1, 2
CONFIGFS = Path("/sys/kernel/config/gpio-sim")


def event(time_ns: int, kind: int, line: int, number: int) -> bytes:
    """Return the bytes of `struct gpio_v2_line_event` of linux/gpio.h."""
    return struct.pack("=QIIII6I", time_ns, kind, line, number, number, *[0] * 6)


def test_each_edge_is_a_sample() -> None:
    edges = GpioEdges({"limit": 17, "index": 27})
    data = event(10, RISING, 17, 1) + event(20, RISING, 27, 2) + event(30, FALLING, 17, 3)
    assert [(each.time_ns, dict(each.values)) for each in edges.feed(data, 40)] == [
        (10, {"limit": 1, "index": -1}),
        (20, {"limit": 1, "index": 1}),
        (30, {"limit": 0, "index": 1}),
    ]
    assert (edges.counters.samples, edges.counters.lost) == (3, 0)


def test_dropped_edges_are_counted() -> None:
    edges = GpioEdges({"limit": 17})
    edges.feed(event(10, RISING, 17, 5) + event(20, RISING, 17, 9), 30)
    assert edges.counters.lost == 3
    edges.start()
    edges.feed(event(10, RISING, 17, 1), 30)
    assert edges.counters.lost == 3


def test_levels_are_unknown_after_dropped_edges() -> None:
    edges = GpioEdges({"limit": 17, "index": 27})
    data = event(10, RISING, 17, 1) + event(20, RISING, 27, 2) + event(30, FALLING, 27, 5)
    assert dict(edges.feed(data, 40)[-1].values) == {"limit": -1, "index": 0}


def test_the_number_of_the_events_wraps() -> None:
    edges = GpioEdges({"limit": 17})
    edges.feed(event(10, RISING, 17, 0xFFFF_FFFF) + event(20, FALLING, 17, 0), 30)
    assert edges.counters.lost == 0


@given(st.binary(max_size=200))
def test_any_bytes_are_decoded_or_counted(data: bytes) -> None:
    edges = GpioEdges({"limit": 17})
    samples = edges.feed(data, 0)
    assert len(samples) + edges.counters.bad_messages == len(data) // 48
    assert edges.counters.garbage == len(data) % 48


@pytest.mark.parametrize("lines", [{}, {"a": 1, "b": 1}])
def test_lines_that_cannot_work(lines: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="each line once"):
        GpioEdges(lines)
    with pytest.raises(ValueError, match="positive rate"):
        GpioEdges({"a": 1}, rate=0.0)
    with pytest.raises(ValueError, match="bias='up': must be one of"):
        GpioLines("/dev/gpiochip0", [1], bias="up")  # type: ignore[arg-type]


@dataclass
class Request:
    """Request of lines whose events come from a pipe."""

    fd: int
    released: bool = False

    def release(self) -> None:
        self.released = True


def test_events_are_read_from_the_file_of_the_request() -> None:
    reading, writing = os.pipe()
    connection = GpioConnection(request := Request(reading))
    try:
        assert connection.read(0.0)[0] == b""
        os.write(writing, event(10, RISING, 17, 1) * 20)
        before_ns = time.monotonic_ns()
        data, received_ns = connection.read(1.0)
        assert len(data) == 16 * 48  # whole events only
        assert before_ns <= received_ns <= time.monotonic_ns()
        with pytest.raises(OSError, match="take no messages"):
            connection.write(b"x")
    finally:
        connection.close()
        os.close(reading)
        os.close(writing)
    assert request.released


def test_a_chip_that_does_not_exist(tmp_path: Path) -> None:
    pytest.importorskip("gpiod")
    chip = str(tmp_path / "gpiochip9")
    with pytest.raises(OSError, match="No such file") as caught:
        GpioLines(chip, [1]).open()
    assert caught.value.errno == errno.ENOENT
    with pytest.raises(OSError, match="No such file"), GpioOutput(chip, 1):
        pass


@dataclass
class Simulator:
    """Chip of the kernel's simulator with one bank."""

    chip: str
    lines: Path

    def pull(self, line: int, up: bool) -> None:
        (self.lines / f"sim_gpio{line}" / "pull").write_text("pull-up" if up else "pull-down")

    def value(self, line: int) -> str:
        return (self.lines / f"sim_gpio{line}" / "value").read_text().strip()


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    """Chip as described in Documentation/admin-guide/gpio/gpio-sim.rst of the kernel."""
    pytest.importorskip("gpiod")
    if not CONFIGFS.is_dir():
        pytest.skip("no gpio-sim: needs CONFIG_GPIO_SIM, root, configfs and `modprobe gpio-sim`")
    device = CONFIGFS / f"catenary-{os.getpid()}"
    bank = device / "bank0"
    bank.mkdir(parents=True)
    try:
        (bank / "num_lines").write_text("8")
        (device / "live").write_text("1")
        name, chip = (
            (each / kind).read_text().strip()
            for each, kind in ((device, "dev_name"), (bank, "chip_name"))
        )
        yield Simulator(f"/dev/{chip}", Path("/sys/devices/platform", name, chip))
    finally:
        with suppress(OSError):
            (device / "live").write_text("0")
        bank.rmdir()
        device.rmdir()


def test_edges_of_the_simulator(simulator: Simulator) -> None:
    edges = GpioEdges({"limit": 2, "index": 5})
    connection = GpioLines(simulator.chip, edges.lines).open()
    try:
        before_ns = time.monotonic_ns()
        samples = []
        for line, up in ((2, True), (5, True), (2, False)):
            simulator.pull(line, up)
            data, received_ns = connection.read(5.0)  # lines have no order of their interrupts
            samples += edges.feed(data, received_ns)
    finally:
        connection.close()
    assert [dict(each.values) for each in samples] == [
        {"limit": 1, "index": -1},
        {"limit": 1, "index": 1},
        {"limit": 0, "index": 1},
    ]
    times = [each.time_ns for each in samples]
    assert times == sorted(times)
    assert before_ns <= times[0] <= times[-1] <= received_ns


def test_an_output_of_the_simulator(simulator: Simulator) -> None:
    with GpioOutput(simulator.chip, 3, initial=True) as lamp:
        assert simulator.value(3) == "1"
        lamp.write(False)
        assert simulator.value(3) == "0"
        with pytest.raises(OSError, match="busy"):
            GpioLines(simulator.chip, [3]).open()
