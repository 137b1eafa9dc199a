"""The table of a device's process data."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from catenary.bus import MainDevice
from catenary.model.device import Direction
from catenary.virtual import Coupler, DigitalOutputs, Segment
from tests.force_sensor import ForceSensor


@pytest.fixture
def main() -> Iterator[MainDevice]:
    with MainDevice(Segment([Coupler(), ForceSensor(), DigitalOutputs(bits=10)])) as main:
        main.scan()
        yield main


def test_rows_have_the_offsets_of_the_process_data(main: MainDevice) -> None:
    rows = [row for row in main.subs[1].pdos if row.index]
    assert [(r.direction, r.pdo, r.index, r.name, r.type, r.bit_offset) for r in rows] == [
        (Direction.OUTPUT, 0x1600, 0x7000, "Tare", "BOOL", 0),
        (Direction.OUTPUT, 0x1600, 0x7010, "Lamp", "UINT", 8),
        (Direction.INPUT, 0x1A00, 0x6000, "Force", "REAL", 0),
        (Direction.INPUT, 0x1A00, 0x6000, "Rate", "INT", 32),
    ]


def test_a_second_sync_manager_follows_the_first(main: MainDevice) -> None:
    table = main.subs[2].pdos
    assert [row.bit_offset for row in table] == list(range(10))
    assert "outputs: 2 bytes" in str(table)


def test_it_prints_as_a_table(main: MainDevice) -> None:
    lines = str(main.subs[1].pdos).splitlines()
    assert lines[0] == "device 1 (Force sensor), mapping from CoE"
    assert lines[2].split() == ["PDO", "object", "name", "type", "bits", "bit", "offset"]
    assert lines[3] == "    0x1600 Commands  0x7000:01  Tare  BOOL  1     0"
    assert lines[4].split() == ["0x1600", "Commands", "gap", "7", "1"]
    assert repr(main.subs[1].pdos) == str(main.subs[1].pdos)


def test_a_device_without_process_data_has_an_empty_table(main: MainDevice) -> None:
    table = main.subs[0].pdos
    assert len(table) == 0
    assert "inputs: 0 bytes" in str(table)
