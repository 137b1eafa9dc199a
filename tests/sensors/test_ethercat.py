from __future__ import annotations

from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

import catenary as cat
from catenary.drive import ProcessData
from catenary.errors import ShareError
from catenary.sensors import Calibration, Channel
from catenary.sensors.analog import analog_wrench
from catenary.sensors.ethercat import EtherCat, Field, LoopSource
from catenary.virtual import AnalogInputs, Coupler, Segment
from tests.force_sensor import ForceSensor
from tests.share.names import own_name

VOLT = 10 / 0x7FFF


class Rig:
    """A loop with six analogue inputs and a force sensor, and its share."""

    def __init__(self, name: str, gauges: AnalogInputs, force: ForceSensor) -> None:
        self.name, self.gauges, self.force = name, gauges, force
        self.loop: cat.Loop
        self.inputs: cat.Inputs

    @property
    def values(self) -> list[str]:
        return [name for name in self.inputs.names if "Value" in name]


@pytest.fixture
def rig() -> Iterator[Rig]:
    gauges, force = AnalogInputs(channels=6), ForceSensor()
    segment = Segment([Coupler(), gauges, force])
    with own_name("arm") as name, cat.MainDevice(segment) as main:
        made, subs = Rig(name, gauges, force), main.scan()
        made.inputs, sensor = cat.Inputs(subs[1]), ProcessData(subs[2], required=False)
        with cat.Share(name) as share, cat.Loop(made.inputs, sensor, sink=share) as made.loop:
            next(made.loop)
            yield made


def cycles(rig: Rig, count: int) -> None:
    for _ in range(count):
        next(rig.loop)


def test_analogue_inputs_become_a_wrench_in_the_time_of_the_cycle(rig):
    matrix = np.diag([100.0, 100.0, 200.0, 1.0, 2.0, 3.0])
    source = LoopSource(rig.name)
    source.layout = msgspec.structs.replace(source.layout, clock="monotonic")  # as on a wire
    fields = [Field(name, scale=VOLT) for name in rig.values]
    sensor = analog_wrench(source, fields, Calibration(matrix))
    for channel, volts in enumerate((1.0, -2.0, 0.5, 0.1, 0.2, 0.3)):
        rig.gauges.apply_volts(channel, volts)
    cycles(rig, 3)
    connection = source.open()
    cycles(rig, 2)
    samples = sensor.feed(*connection.read(1.0))
    connection.close()
    force, torque = samples[-1].values["force"], samples[-1].values["torque"]
    assert np.asarray(force) == pytest.approx([100.0, -200.0, 100.0], abs=0.1)
    assert np.asarray(torque) == pytest.approx([0.1, 0.4, 0.9], abs=0.01)
    with cat.attach(rig.name) as arm:
        assert samples[-1].time_ns == arm.read()["scheduled_ns"]
    assert samples[-1].valid
    assert sensor.rate == pytest.approx(1.0 / arm.layout.period)


def test_bytes_of_process_data_become_numbers(rig):
    source = LoopSource(rig.name)
    sensor = EtherCat(source, {Channel("force", "N"): [Field("input_bytes", 0, "<f4", scale=2.0)]})
    rig.force.force = 1.5
    rig.force.measure()
    connection = source.open()
    cycles(rig, 3)
    samples = sensor.feed(*connection.read(1.0))
    connection.close()
    assert samples[-1].values["force"] == 3.0


def test_an_input_out_of_range_is_invalid(rig):
    source = LoopSource(rig.name)
    fields = [Field(name, scale=VOLT) for name in rig.values]
    errors = [name for name in rig.inputs.names if "Overrange" in name]
    by_flag = analog_wrench(source, fields, Calibration(np.eye(6)), errors=errors)
    by_limit = analog_wrench(source, fields, Calibration(np.eye(6)), limit=9.5)
    rig.gauges.apply_volts(2, 11.0)
    cycles(rig, 3)
    connection = source.open()
    cycles(rig, 2)
    data, received = connection.read(1.0)
    connection.close()
    assert errors[2] in by_flag.feed(data, received)[-1].reason
    assert "saturated" in by_limit.feed(data, received)[-1].reason


def test_every_nth_cycle_is_used_and_lost_cycles_are_counted(rig):
    source = LoopSource(rig.name)
    sensor = EtherCat(source, {Channel("gauge", "V"): rig.values[:1]}, every=5)
    connection = source.open()
    cycles(rig, 20)
    data, received = connection.read(1.0)
    connection.close()
    size = source.layout.rows.size
    assert len(sensor.feed(data, received)) == 4
    sensor.start()
    sensor.feed(data[: 2 * size] + data[5 * size :], received)
    assert sensor.counters.lost == 3


def test_a_cycle_without_an_answer_is_invalid(rig):
    source = LoopSource(rig.name)
    sensor = EtherCat(source, {Channel("gauge", "V"): rig.values[:1]})
    first = EtherCat(source, {Channel("gauge", "V"): rig.values[:1]}, unit=0)
    row = np.zeros(1, source.layout.dtype)
    row["number"], row["unit_valid"] = 1, 1
    row["unit_valid"][0, -1] = 0
    (sample,) = sensor.feed(row.tobytes(), 0)
    assert (sample.valid, sample.reason) == (False, "the device did not answer in this cycle")
    assert first.feed(row.tobytes(), 0)[0].valid


def test_in_virtual_time_the_reception_counts():
    segment = Segment([Coupler(), ForceSensor()], clock="virtual")
    with own_name("arm") as name, cat.MainDevice(segment) as main:
        sensor = ProcessData(main.scan()[1])
        with cat.Share(name) as share, cat.Loop(sensor, sink=share) as loop:
            next(loop)
            source = LoopSource(name)
            force = EtherCat(source, {Channel("force", "N"): [Field("input_bytes", 0, "<f4")]})
            connection = source.open()
            next(loop)
            samples = force.feed(*connection.read(1.0))
            connection.close()
    assert [sample.time_ns for sample in samples] == [None] * len(samples)
    assert samples


def test_the_end_of_the_loop_ends_the_connection(rig):
    source = LoopSource(rig.name)
    connection = source.open()
    rig.loop.close()
    connection.read(0.01)  # the last cycles
    with pytest.raises(OSError, match="the loop has ended"):
        connection.read(0.01)
    connection.close()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (["nothing"], "unknown field 'nothing'"),
        (["number", "number"], "needs 1 fields"),
        (["unit_valid"], "is not one number"),
        ([Field("unit_valid", 99)], "is not one number"),
        ([Field("input_bytes", 1000, "<f4")], "is not one number"),
    ],
)
def test_a_field_that_does_not_fit_is_refused(rig, fields, message):
    with pytest.raises(ValueError, match=message):
        EtherCat(LoopSource(rig.name), {Channel("gauge"): fields})


def test_a_missing_loop_is_refused():
    with pytest.raises(ShareError, match="there is no share"):
        LoopSource("test-no-such-loop")
