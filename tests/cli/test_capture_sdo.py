"""`catenary capture sdo`: the printed list loads in a machine file, and as Python code."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.capture.recordings import record

MACHINE = """
format = "catenary-machine/1"
target = "virtual"

[[device]]
name = "j1"
position = 1
identity = { vendor = 0x43544E59, product = 0x50001 }
"""


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    record(tmp_path / "a.pcapng", pdos=[0x1601, 0x1A00])
    return tmp_path / "a.pcapng"
