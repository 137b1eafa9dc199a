"""Fixtures for tests with other EtherCAT programs, over a pair of network interfaces."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from catenary.realtime.child import Child, start_python

# Whole bytes: SOEM's expected counter omits a device whose bits do not fill a byte, because its
# difference of logical addresses is 0. With 4-bit terminals, the counter is too low.
LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "digital_outputs"
bits = 8

[[device]]
kind = "servo"
name = "shoulder"
serial = 1

[[device]]
kind = "servo"
name = "elbow"
serial = 2

[[device]]
kind = "analog_inputs"
name = "thermometer"

[[device]]
kind = "digital_inputs"
bits = 16
"""


def serve_command(interface: str, file: Path, *, max_age: float = 1e6) -> list[str]:
    """Return the command `catenary virtual serve` in real time, or with `max_age` [s].

    By default, late frames are answered, because SOEM does not check the mailbox counter. After a
    lost frame, it takes an old message for a new one.
    """
    command = ["-m", "catenary.cli", "virtual", "serve", interface, "--config", str(file)]
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except PermissionError:
        return [*command, "--max-age", str(max_age)]
    os.sched_setscheduler(0, *before)
    return [*command, "--priority", "50"]


@contextmanager
def serving(interface: str, file: Path, *, max_age: float = 1e6) -> Iterator[Child]:
    """Serve the devices of a file on an interface, and yield the serving process."""
    with start_python(serve_command(interface, file, max_age=max_age)) as server:
        assert server.read_line(20.0), "the virtual segment did not start"
        yield server


@pytest.fixture
def line(tmp_path: Path) -> Path:
    """Return the devices of `served`."""
    file = tmp_path / "line.toml"
    file.write_text(LINE)
    return file


@pytest.fixture
def served(veth: tuple[str, str], line: Path) -> Iterator[str]:
    """Yield an interface with served virtual devices at its other end."""
    ours, theirs = veth
    with serving(theirs, line):
        yield ours
