"""Start-up objects on devices: written, read back, and written again when the device returns."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary import types
from catenary.bus import MainDevice
from catenary.drive import Drives, Inputs, Outputs, ProcessData, StartUp
from catenary.errors import ConfigurationError, SdoAbort
from catenary.virtual import Coupler, Segment
from catenary.virtual.faults import power_cycle
from tests.force_sensor import ForceSensor, TunedServo

SERVO, SENSOR = 1, 2
GAIN = (0x2010, 3, b"\x00\x00\xc0\x3f")


class Cell:
    def __init__(self) -> None:
        self.servo, self.sensor = TunedServo(), ForceSensor()
        self.segment = Segment([Coupler(), self.servo, self.sensor])
        self.main = MainDevice(self.segment)


@pytest.fixture
def cell() -> Iterator[Cell]:
    cell = Cell()
    with cell.main:
        cell.main.scan()
        yield cell


def arm_of(cell: Cell) -> Drives:
    return Drives(cell.main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)


@pytest.mark.parametrize("request_class", [Inputs, Outputs, ProcessData, Drives])
def test_every_request_accepts_start_up_objects(cell: Cell, request_class: type) -> None:
    start_up = [StartUp(0x2010, 3, 1.5), StartUp(0x2100, 0, 1)]
    if request_class is Drives:
        request = Drives(
            cell.main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0, start_up=start_up
        )
    else:
        request = request_class(cell.main.subs[SENSOR], start_up=start_up)
    with cat.Loop(request):
        device = cell.servo if request_class is Drives else cell.sensor
        assert device.writes == [GAIN, (0x2100, 0, b"\x01\x00")]


def test_objects_are_written_before_or_after_the_mapping(cell: Cell) -> None:
    sensor = ProcessData(
        cell.main.subs[SENSOR],
        inputs={"status": (0x6010, 0, types.UDINT)},
        start_up=[StartUp(0x2010, 3, 1.5), StartUp(0x2100, 0, 1, before_mapping=True)],
    )
    with cat.Loop(sensor):
        places = [write[:2] for write in cell.sensor.writes]
    assert places == [(0x2100, 0), (0x1C13, 0), (0x1C13, 0), (0x2010, 3)]


def test_a_value_changed_by_the_device_is_an_error(cell: Cell) -> None:
    data = ProcessData(cell.main.subs[SENSOR], start_up=[StartUp(0x2011, 0, 9)])
    with (
        pytest.raises(
            ConfigurationError,
            match=r"device 2 \(Force sensor\): start-up object 0x2011:00: wrote 9 \(USINT\), bytes "
            r"09; read back 05",
        ) as caught,
        cat.Loop(data),
    ):
        pass
    assert "verify=False" in str(caught.value.hint)
    data = ProcessData(cell.main.subs[SENSOR], start_up=[StartUp(0x2011, 0, 9, verify=False)])
    with cat.Loop(data):
        pass
    assert cell.main.subs[SENSOR].sdo.read(0x2011, 0) == b"\x05"


def test_a_refused_object_is_an_error(cell: Cell) -> None:
    data = ProcessData(cell.main.subs[SENSOR], start_up=[StartUp(0x2222, 1, b"\x01")])
    with (
        pytest.raises(SdoAbort, match=r"start-up object 0x2222:01 = 01 refused with 0x06020000"),
        cat.Loop(data),
    ):
        pass


def test_an_unknown_object_is_an_error(cell: Cell) -> None:
    data = ProcessData(cell.main.subs[SENSOR], start_up=[StartUp(0x2222, 1, 5)])
    with pytest.raises(ConfigurationError, match="0x2222:01 is unknown: the object dictionary"):
        cell.main.plan(data)
    assert cell.sensor.writes == []


def test_objects_are_written_again_when_the_device_returns(cell: Cell) -> None:
    start_up = [StartUp(0x2010, 3, 1.5), StartUp(0x2100, 0, 1, before_mapping=True)]
    sensor = ProcessData(
        cell.main.subs[SENSOR],
        inputs={"status": (0x6010, 0, types.UDINT)},
        start_up=start_up,
        required=False,
    )
    with cat.Loop(arm_of(cell), sensor) as loop:
        cell.sensor.writes.clear()
        cell.segment.inject(power_cycle(SENSOR, at=0.05, for_=0.1))
        for cycle in loop:
            if cycle.time > 1.0:
                break
        assert sensor.present
        assert sensor["status"] == 7
        places = [write[:2] for write in cell.sensor.writes]
        assert places == [(0x2100, 0), (0x1C13, 0), (0x1C13, 0), (0x2010, 3)]
