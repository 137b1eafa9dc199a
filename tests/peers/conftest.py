"""Foreign programs that judge us, over a pair of network interfaces."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.realtime.child import start_python

# Whole bytes: SOEM's expected counter forgets a device whose bits fill no byte up (the difference
# of logical addresses is 0 there), so that with 4-bit terminals it is too low.
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


@pytest.fixture
def line(tmp_path: Path) -> Path:
    """The devices behind `served`."""
    file = tmp_path / "line.toml"
    file.write_text(LINE)
    return file


@pytest.fixture
def served(veth: tuple[str, str], line: Path) -> Iterator[str]:
    """An interface at the other end of which virtual devices answer, as a user starts them."""
    ours, theirs = veth
    command = ["-m", "catenary.cli", "virtual", "serve", theirs, "--config", str(line)]
    with start_python(command) as server:
        assert server.read_line(20.0), "the virtual segment did not start"
        yield ours
