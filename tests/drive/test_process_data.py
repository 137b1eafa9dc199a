"""Process data of any device, as bytes and by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import catenary as cat
from catenary import types
from catenary.bus import MainDevice
from catenary.drive import Channel, Drives, Inputs, Outputs, ProcessData, StartUp
from catenary.errors import ConfigurationError, MappingError
from catenary.virtual import Coupler, DigitalOutputs, Segment
from tests.force_sensor import ForceSensor, TunedServo

SENSOR, TERMINAL, SERVO = 1, 2, 3


class Cell:
    """A segment and its MainDevice."""

    def __init__(self) -> None:
        self.sensor, self.terminal, self.servo = ForceSensor(), DigitalOutputs(), TunedServo()
        self.main = MainDevice(Segment([Coupler(), self.sensor, self.terminal, self.servo]))


@pytest.fixture
def cell() -> Iterator[Cell]:
    cell = Cell()
    with cell.main:
        cell.main.scan()
        yield cell


def steps(loop: cat.Loop, count: int) -> None:
    for _ in range(count):
        next(loop)


def test_bytes_are_the_devices_image(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR])
    cell.sensor.rate = -2
    cell.sensor.measure()
    with cat.Loop(raw) as loop:
        outputs, inputs = raw.outputs, raw.inputs
        assert (len(outputs), len(inputs)) == (3, 6)
        outputs[1:3] = b"\x34\x12"
        steps(loop, 5)
        assert cell.sensor.lamp == 0x1234
        assert bytes(inputs[4:6]) == b"\xfe\xff"
        assert raw.outputs is outputs
        assert raw.inputs is inputs
        with pytest.raises(TypeError, match="read-only"):
            inputs[0] = 1


def test_inputs_change_only_with_the_iteration(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR])
    with cat.Loop(raw, period=1e-3) as loop:
        cycle = next(loop)
        before = bytes(raw.inputs)
        cell.sensor.rate = 77
        cell.sensor.measure()
        cycle.spend(5e-3)  # cycles run meanwhile
        assert bytes(raw.inputs) == before
        steps(loop, 3)
        assert raw["Rate"] == 77


def test_mapped_objects_have_their_names(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR])
    assert raw.names == ("Force", "Rate", "Tare", "Lamp")
    cell.sensor.force = 1.5
    cell.sensor.measure()
    with cat.Loop(raw) as loop:
        raw["Lamp"] = 700
        raw["Tare"] = True
        steps(loop, 5)
        assert (raw["Force"], raw["Lamp"], raw["Tare"]) == (1.5, 700, True)
        assert (cell.sensor.lamp, cell.sensor.tare) == (700, True)
        assert bytes(raw.outputs) == b"\x01\xbc\x02"


def test_nothing_is_written_to_the_device(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR])
    assert cell.main.plan(raw).devices[SENSOR].downloads == ()


def test_unmapped_objects_are_mapped(cell: Cell) -> None:
    """Without `pdos` the planner searches."""
    sensor = ProcessData(
        cell.main.subs[SENSOR],
        inputs={"status": (0x6010, 0, types.UDINT), "force": (0x6000, 1, types.REAL)},
        outputs={},
    )
    changes = cell.main.plan(sensor).devices[SENSOR].changes
    assert [change.what for change in changes] == ["0x1A00"]
    with cat.Loop(sensor) as loop:
        steps(loop, 3)
        assert sensor["status"] == 7


def test_a_scale_and_a_channel(cell: Cell) -> None:
    sensor = ProcessData(
        cell.main.subs[SENSOR],
        inputs={
            "rate": (0x6000, 0x12, types.INT, 0.5),
            "same": Channel(0x6000, 0x12, types.INT, 0.25, unit="rad/s"),
        },
    )
    cell.sensor.rate = -10
    cell.sensor.measure()
    with cat.Loop(sensor) as loop:
        steps(loop, 3)
        assert (sensor["rate"], sensor["same"]) == (-5.0, -2.5)


def test_named_inputs_are_columns_for_laws_and_recordings(cell: Cell) -> None:
    sensor = ProcessData(cell.main.subs[SENSOR], inputs={"rate": (0x6000, 0x12, types.INT)})
    [column] = cell.main.plan(sensor).cycle.input_columns[:1]
    assert (column.name, column.device) == ("rate", SENSOR)


def test_pdos_with_entries_by_name_and_unchanged(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    named = ProcessData(
        sub,
        inputs={"force": (0x6000, 1, types.REAL), "status": (0x6010, 0, types.UDINT)},
        pdos={0x1A00: ["status", (0x6000, 1, 32)]},
    )
    with cat.Loop(named) as loop:
        steps(loop, 3)
        assert bytes(named.inputs[:4]) == b"\x07\x00\x00\x00"
    with pytest.raises(
        ValueError, match=r"unknown name 'stats' in 0x1A00; .*did you mean 'status'"
    ):
        ProcessData(sub, inputs={"status": (0x6010, 0, types.UDINT)}, pdos={0x1A00: ["stats"]})


def test_an_object_that_the_written_pdos_lack(cell: Cell) -> None:
    sensor = ProcessData(
        cell.main.subs[SENSOR],
        inputs={"force": (0x6000, 1, types.REAL), "status": (0x6010, 0, types.UDINT)},
        pdos={0x1A00: ["force"]},
    )
    with pytest.raises(MappingError, match=r"0x6010:00 \(32 bits\) is not in them"):
        cell.main.plan(sensor)


def test_a_divider_and_a_device_that_is_not_required(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR], divider=4, required=False)
    terminal = Outputs(cell.main.subs[TERMINAL])
    plan = cell.main.plan(raw, terminal)
    unit = plan.cycle.sync_units[plan.layout.sync_unit(SENSOR)]
    assert (unit.divider, unit.optional) == (4, True)
    with cat.Loop(raw, terminal) as loop:
        steps(loop, 8)
        assert raw.present
        raw.outputs[1] = 9
        steps(loop, 8)
        assert cell.sensor.lamp == 9


def test_invalid_options_are_refused_before_anything_is_sent(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    both = {"x": (0x6000, 0x12, types.INT)}
    with pytest.raises(ValueError, match="'x' names an input and an output"):
        ProcessData(sub, inputs=both, outputs={"x": (0x7010, 0, types.UINT)})
    with pytest.raises(
        ValueError, match="safe: unknown name 'lmp'; the names are lamp; did you mean"
    ):
        ProcessData(sub, outputs={"lamp": (0x7010, 0, types.UINT)}, safe={"lmp": 1})
    with pytest.raises(ValueError, match=r"safe\['lamp'\] = 70000: UINT"):
        ProcessData(sub, outputs={"lamp": (0x7010, 0, types.UINT)}, safe={"lamp": 70_000})
    with pytest.raises(ValueError, match="this request writes no outputs"):
        ProcessData(sub, outputs={}, safe=b"\x01")
    with pytest.raises(ConfigurationError, match=r"safe has 2 bytes, but the outputs .* have 3"):
        cell.main.plan(ProcessData(sub, safe=b"\x01\x02"))


def test_arguments_of_the_wrong_type_are_refused(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    wrong: Any = cell.main.subs  # type checkers also refuse these arguments
    with pytest.raises(TypeError, match=r"ProcessData takes SubDevices.*not <\d SubDevices"):
        ProcessData(wrong)
    for wrong in ([1], 3):
        with pytest.raises(TypeError, match=r"safe=.*: give \{name: value\}, or the bytes"):
            ProcessData(sub, safe=wrong)
    wrong = [(0x6000, 1, types.REAL)]
    with pytest.raises(TypeError, match=r"inputs=\[\(.*: give \{name: \(index, subindex, type\)\}"):
        ProcessData(sub, inputs=wrong)
    for wrong in ({"0x1A00": ["x"]}, 0x1A00):
        with pytest.raises(TypeError, match=r"pdos=.*: give PDO numbers, \[0x1A00\]"):
            ProcessData(sub, pdos=wrong)
    for wrong in ([(0x2010, 0, 1)], {(0x2010, 0): 1}, StartUp(0x2010, 0, 1)):
        for request in (ProcessData, Outputs):
            with pytest.raises(TypeError, match=r"start_up=.*: give a list, \[StartUp\(index"):
                request(sub, start_up=wrong)


def test_a_device_list_is_not_a_device(cell: Cell) -> None:
    subs: Any = cell.main.subs
    with pytest.raises(TypeError, match=r"Inputs takes SubDevices, such as subs\[1\]"):
        Inputs(subs)


def test_names_can_be_iterated(cell: Cell) -> None:
    raw, outputs = ProcessData(cell.main.subs[SENSOR]), Outputs(cell.main.subs[SENSOR])
    assert tuple(raw) == raw.names
    assert "Lamp" in raw
    assert "Lmp" not in raw
    assert tuple(outputs) == outputs.names
    number: Any = 0
    with pytest.raises(TypeError, match="0 is not a name"):
        _ = raw[number]


def test_text_is_not_a_boolean(cell: Cell) -> None:
    text: Any = "off"
    with pytest.raises(TypeError, match=r"safe\['Tare'\] = 'off': BOOL: 'off' is text"):
        ProcessData(cell.main.subs[SENSOR], safe={"Tare": text})
    raw = ProcessData(cell.main.subs[SENSOR])
    with cat.Loop(raw):
        with pytest.raises(TypeError, match=r"'Tare' = 'off': BOOL: 'off' is text"):
            raw["Tare"] = text
        assert raw["Tare"] is False


def test_invalid_values_are_refused(cell: Cell) -> None:
    raw = ProcessData(cell.main.subs[SENSOR])
    with pytest.raises(RuntimeError, match=r"ProcessData\(1 Force sensor\) has no values before"):
        _ = raw.inputs
    with pytest.raises(RuntimeError, match="'Lamp' has no value before a Loop is open"):
        raw["Lamp"] = 1
    with cat.Loop(raw):
        with pytest.raises(KeyError, match=r"unknown name 'Lmp'.*did you mean 'Lamp'"):
            raw["Lmp"] = 1
        with pytest.raises(TypeError, match="'Force' is an input"):
            raw["Force"] = 1.0
        with pytest.raises(ValueError, match="'Lamp' = 65536: UINT: 65536 is not in 0 to 65535"):
            raw["Lamp"] = 65_536
        with pytest.raises(TypeError, match=r"'Lamp' = 1\.5"):
            raw["Lamp"] = 1.5
        with pytest.raises(AttributeError, match="no attribute 'outpts'; did you mean 'outputs'"):
            raw.outpts = b""
        with pytest.raises(AttributeError, match=r"ProcessData\.outputs is read-only"):
            raw.outputs = b"\x01\x02\x03"  # type: ignore[misc, assignment]


def test_a_byte_that_two_requests_write(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    lamp = Outputs(sub, channels={"lamp": (0x7010, 0, types.UINT)})
    with pytest.raises(
        ConfigurationError,
        match=r"device 1 \(Force sensor\): two requests write byte 1 of its outputs: "
        r"Outputs\(1 Force sensor\) \(lamp\) and ProcessData\(1 Force sensor\)",
    ):
        cell.main.plan(lamp, ProcessData(sub))


def test_a_read_only_request_combines_with_another(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    lamp = Outputs(sub, channels={"lamp": (0x7010, 0, types.UINT)})
    tare = Outputs(sub, channels={"tare": (0x7000, 1, types.BOOL)})
    reads = ProcessData(sub, outputs={})
    with cat.Loop(lamp, tare, reads) as loop:
        lamp["lamp"] = 5
        tare["tare"] = 1
        steps(loop, 4)
        assert (cell.sensor.lamp, cell.sensor.tare) == (5, True)
        with pytest.raises(RuntimeError, match="cannot write outputs"):
            _ = reads.outputs


def test_two_drives_requests_for_one_axis(cell: Cell) -> None:
    def arm() -> Drives:
        return Drives(cell.main.subs.drives, counts_per_turn=2**20, velocity_limit=1.0)

    with pytest.raises(
        ConfigurationError,
        match=r"two requests write byte 0 of its outputs: Drives\(.*\) \(controlword\)",
    ):
        cell.main.plan(arm(), arm())


def test_inputs_and_outputs_by_chosen_objects(cell: Cell) -> None:
    sub = cell.main.subs[SENSOR]
    force = Inputs(
        sub, channels={"force": (0x6000, 1, types.REAL), "state": (0x6010, 0, types.UDINT)}
    )
    cell.sensor.force = 2.25
    cell.sensor.measure()
    with cat.Loop(force) as loop:
        steps(loop, 3)
        assert (force["force"], force["state"]) == (2.25, 7)
        assert force.reals.tolist() == [2.25]
        assert force.integers.tolist() == [7]
    with pytest.raises(ValueError, match="channels= needs exactly one device, not 2"):
        Inputs(sub, sub, channels={"force": (0x6000, 1, types.REAL)})
