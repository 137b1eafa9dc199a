"""Wrenches and inertial data from the shares of sensors."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.ros2 import messages
from catenary.ros2.config import Config, Imu, Wrench
from catenary.ros2.readings import InvalidReading, check_sample, numbers
from catenary.ros2.source import value_of
from catenary.sensors.publisher import SensorShare
from catenary.sensors.sensor import Channel
from tests.ros2.bridges import Rig, rig
from tests.share.names import own_name

WRENCH = (Channel("force", "N", (3,)), Channel("torque", "N·m", (3,)))
INERTIAL = (
    Channel("acceleration", "m/s²", (3,)),
    Channel("angular_velocity", "rad/s", (3,)),
    Channel("quaternion", "", (4,)),
)
ORIENTATION = ("quaternion[1]", "quaternion[2]", "quaternion[3]", "quaternion[0]")
LOAD = {"force": [1.0, 2.0, 3.0], "torque": [0.1, 0.2, 0.3]}


@contextmanager
def sensor(channels: tuple[Channel, ...]) -> Iterator[SensorShare]:
    with own_name("sensor") as name, SensorShare(name, channels, rate=500.0) as share:
        yield share


def diagnosis(running: Rig, share: str) -> messages.DiagnosticStatus:
    running.bridge._publishing._diagnostics_at = 0.0
    running.step()
    found = running.sent("/diagnostics")[-1].status
    return next(each for each in found if each.name == f"{share}: sensor")


def test_a_wrench_has_the_time_and_the_frame_of_its_sample() -> None:
    with sensor(WRENCH) as share:
        config = Config(wrench=(Wrench(share=share.name, frame="tool", max_age=60.0),))
        with rig(config) as running:
            time_ns = time.monotonic_ns()
            share.publish(LOAD, time_ns)
            running.step()
            [message] = running.sent("wrench")
            with cat.attach(share.name) as reader:
                offset = reader.layout.utc_offset_ns
        assert message.header.frame_id == "tool"
        assert message.header.stamp.to_ns() == time_ns + offset
        assert message.wrench.force == messages.Vector3(1.0, 2.0, 3.0)
        assert message.wrench.torque == messages.Vector3(0.1, 0.2, 0.3)


def test_an_invalid_sample_is_not_published_and_the_reason_is_given() -> None:
    with sensor(WRENCH) as share:
        config = Config(wrench=(Wrench(share=share.name, max_age=60.0),))
        with rig(config) as running:
            share.publish(LOAD, time.monotonic_ns(), valid=False, reason="saturated")
            running.step()
            assert running.sent("wrench") == []
            status = diagnosis(running, share.name)
            assert status.level == messages.DiagnosticStatus.ERROR
            assert status.message == "the sensor reports invalid data"


def test_a_sample_is_never_repeated() -> None:
    with sensor(WRENCH) as share:
        config = Config(wrench=(Wrench(share=share.name, max_age=60.0),))
        with rig(config) as running:
            share.publish(LOAD, time.monotonic_ns())
            for _ in range(3):
                running.step()
            assert len(running.sent("wrench")) == 1


def test_an_old_sample_is_invalid() -> None:
    with sensor(WRENCH) as share:
        share.publish(LOAD, time.monotonic_ns() - 10_000_000_000)
        with cat.attach(share.name) as reader, pytest.raises(InvalidReading, match="limit is 1 s"):
            check_sample(reader, reader.read(), max_age=1.0)


def test_inertial_data_with_and_without_orientation() -> None:
    values = {
        "acceleration": [0.0, 0.0, 9.8],
        "angular_velocity": [0.1, 0.2, 0.3],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
    }
    with sensor(INERTIAL) as share:
        known = Imu(share=share.name, max_age=60.0, orientation=ORIENTATION)
        unknown = Imu(share=share.name, topic="raw", max_age=60.0)
        with rig(Config(imu=(known, unknown))) as running:
            share.publish(values, time.monotonic_ns())
            running.step()
            [imu], [raw] = running.sent("imu/data"), running.sent("raw")
    assert imu.linear_acceleration == messages.Vector3(0.0, 0.0, 9.8)
    assert imu.angular_velocity == messages.Vector3(0.1, 0.2, 0.3)
    assert imu.orientation == messages.Quaternion(0.0, 0.0, 0.0, 1.0)
    assert imu.orientation_covariance[0] == 0.0
    assert raw.orientation_covariance[0] == -1.0


def test_a_missing_sensor_is_awaited() -> None:
    with own_name("sensor") as name:
        config = Config(wrench=(Wrench(share=name, max_age=60.0),))
        with rig(config) as running:
            running.step()
            assert "there is no share" in diagnosis(running, name).message
            with SensorShare(name, WRENCH, rate=500.0) as share:
                share.publish(LOAD, time.monotonic_ns())
                running.bridge._publishing._sensors[name]._retry_at = 0.0
                running.step()
                assert len(running.sent("wrench")) == 1


def test_a_field_with_a_wrong_shape_is_reported() -> None:
    with sensor(WRENCH) as share:
        share.publish(LOAD, time.monotonic_ns())
        with cat.attach(share.name) as reader:
            row = reader.read()
    with pytest.raises(ValueError, match=r"name one: force\[0\]"):
        numbers(row, ("force", "force[0]"))
    with pytest.raises(ValueError, match=r"'force' has 3 elements"):
        value_of(row, "force[3]")
    with pytest.raises(ValueError, match="there is no field 'weight'"):
        value_of(row, "weight")
