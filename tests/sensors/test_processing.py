from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catenary.sensors import Calibration, Channel, Frame, Sample
from catenary.sensors.processing import Bias, Calibrate, Filter, Processed, Transform
from tests.sensors.scripted import Lines, line

MS = 1_000_000


class Gauges(Lines):
    """Six raw values: each sample is [time, [6 values]]. A time of null is an invalid sample."""

    channels = (Channel("raw", "V", (6,)), Channel("status"))

    def feed(self, data, received_ns):
        samples = super().feed(data, received_ns)
        return [
            Sample(each.time_ns, {"raw": each.values["value"], "status": 0.0}, each.time_ns != 0)
            for each in samples
        ]


def raw(*values: float) -> bytes:
    return line(1, list(values))


def test_a_calibrated_sensor_has_force_and_torque():
    sensor = Processed(Gauges(), [Calibrate("raw", Calibration(np.diag(range(1, 7))))])
    assert [channel.name for channel in sensor.channels] == ["status", "force", "torque"]
    (sample,) = sensor.feed(raw(1, 1, 1, 1, 1, 1), 0)
    assert sample.values["force"].tolist() == [1, 2, 3]
    assert sample.values["torque"].tolist() == [4, 5, 6]
    assert sample.values["status"] == 0.0


def test_a_bias_is_subtracted():
    sensor = Processed(Gauges(), [Bias({"raw": [1, 2, 3, 4, 5, 6]})])
    (sample,) = sensor.feed(raw(1, 1, 1, 1, 1, 1), 0)
    assert sample.values["raw"].tolist() == [0, -1, -2, -3, -4, -5]


def test_a_saturated_gauge_is_invalid():
    sensor = Processed(Gauges(), [Calibrate("raw", Calibration(np.eye(6)), limit=9.0)])
    assert sensor.feed(raw(0, 0, 9, 0, 0, 0), 0)[0].valid
    (sample,) = sensor.feed(raw(0, 0, -9.1, 0, 0, 0), 0)
    assert (sample.valid, sample.reason) == (False, "'raw' is saturated")


def test_an_invalid_sample_resets_the_filter():
    sensor = Processed(Gauges(), [Filter(["raw"], 10.0, 500.0)])
    sensor.feed(raw(*[100.0] * 6), 0)
    assert not sensor.feed(line(0, [100.0] * 6), 0)[0].valid
    assert sensor.feed(raw(*[1.0] * 6), 0)[0].values["raw"] == pytest.approx([1.0] * 6)


def test_a_restart_resets_the_filter():
    sensor = Processed(Gauges(), [Filter(["raw"], 10.0, 500.0)])
    sensor.feed(raw(*[100.0] * 6), 0)
    sensor.start()
    assert sensor.feed(raw(*[1.0] * 6), 0)[0].values["raw"] == pytest.approx([1.0] * 6)


def test_steps_apply_in_their_order():
    frame = Frame(Rotation.from_euler("z", 90, degrees=True).as_matrix())
    steps = [Calibrate("raw", Calibration(2.0 * np.eye(6))), Transform(frame)]
    (sample,) = Processed(Gauges(), steps).feed(raw(1, 0, 0, 0, 1, 0), 0)
    assert sample.values["force"] == pytest.approx([0, 2, 0])
    assert sample.values["torque"] == pytest.approx([-2, 0, 0])


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (Calibrate("none", Calibration(np.eye(6))), "unknown channel 'none'"),
        (Calibrate("raw", Calibration(np.eye(3))), "the channels need"),
        (Bias({"raw": [1.0]}), "the bias of 'raw'"),
        (Bias({"raw": [float("nan")] * 6}), "the bias of 'raw'"),
        (Filter(["none"], 10.0, 500.0), "unknown channel 'none'"),
        (Transform(Frame()), "unknown channel 'force'"),
        (Transform(Frame(), vectors=["raw"], wrench=None), r"shape \(3,\)"),
    ],
)
def test_a_step_that_does_not_suit_the_channels_is_refused(step, message):
    with pytest.raises(ValueError, match=message):
        Processed(Gauges(), [step])
