"""Programs with process data of any device, and with start-up objects."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from catenary.drive import Drives, Inputs, ProcessData
from catenary.plan.make import Plan
from catenary.virtual import Coupler, DigitalInputs, DigitalOutputs, Segment, Servo
from tests.force_sensor import ForceSensor, TunedServo

RunProgram = Callable[[str, Segment | str], Mapping[str, object]]


def test_raw_process_data_of_an_unknown_device(
    run_program: RunProgram, capsys: pytest.CaptureFixture[str]
) -> None:
    sensor = ForceSensor()
    sensor.rate = 0x1234
    names = run_program("raw_process_data", Segment([Coupler(), Servo(), Servo(), sensor]))
    assert names["word"] == 0x1234
    assert sensor.writes == []
    printed = capsys.readouterr().out
    assert "0x1A00 Readings 0x6000:12 Rate INT 16 32" in " ".join(printed.split())


def test_a_mapping_of_names_and_types(
    run_program: RunProgram, capsys: pytest.CaptureFixture[str]
) -> None:
    sensor = ForceSensor()
    sensor.force = 50.5
    names = run_program("custom_mapping", Segment([Coupler(), sensor]))
    assert names["force"] == 50.5
    data = names["sensor"]
    assert isinstance(data, ProcessData)
    assert data["status"] == 7
    printed = capsys.readouterr().out
    assert "0x1A00  0x6000:01/32, 0x6000:12/16 → 0x6000:01/32, 0x6010:00/32" in printed


def test_start_up_objects_are_written_in_their_order(
    run_program: RunProgram, capsys: pytest.CaptureFixture[str]
) -> None:
    servos = [TunedServo(), TunedServo()]
    names = run_program("start_up_objects", Segment([Coupler(), *servos]))
    for servo in servos:
        assert servo.writes == [
            (0x2100, 0, b"\x01\x00"),
            (0x6065, 0, (20_000).to_bytes(4, "little")),
            (0x2010, 3, b"\x00\x00\xc0\x3f"),
        ]
    assert names["window"] == 20_000
    plan = names["plan"]
    assert isinstance(plan, Plan)
    text = str(plan)
    section = text[text.index("start-up:") :]
    places = [section.index(place) for place in ("0x2100:00", "0x6065:00", "0x2010:03")]
    assert places == sorted(places)
    assert "01 00, not verified" in section
    assert "20000 (UDINT)" in section


def test_outputs_and_inputs_by_name(run_program: RunProgram) -> None:
    terminal, buttons = DigitalOutputs(bits=4), DigitalInputs(bits=2)
    segment = Segment([Coupler(), terminal, buttons])
    buttons.inputs = 1
    names = run_program("io_by_name", segment)
    valves, start = names["valves"], names["buttons"]
    assert isinstance(valves, ProcessData)
    assert isinstance(start, Inputs)
    assert start["start"] == 1
    assert bytes(valves.outputs) == b"\x04"  # the loop has ended: vacuum alone


def test_extra_objects_of_a_drive_are_read_and_written(run_program: RunProgram) -> None:
    servo = TunedServo()
    segment = Segment([Coupler(), servo])
    servo.warm_up(315)
    names = run_program("extra_objects", segment)
    arm = names["arm"]
    assert isinstance(arm, Drives)
    assert arm.actual["temperature"] == pytest.approx([31.5])
    assert servo.lamp == 1
    assert arm.target["torque_feed_forward"].tolist() == [12]
