"""Samples of MicroStrain's inertial sensors, and the commands that start them."""

from __future__ import annotations

import math
import struct

import pytest

from catenary.sensors import mip_commands as commands
from catenary.sensors.mip import Mip
from catenary.sensors.mip_fields import FIELDS
from tests.sensors import mip_device as device
from tests.sensors.test_mip_packet import SENSOR_DATA

IMU = ["acceleration", "angular_velocity"]
PERIOD_NS = 2_000_000


def sensor(fields: list[str] = IMU, **options) -> Mip:
    return Mip(fields, rate=500.0, **options)


def test_values_of_a_packet_of_the_manufacturer() -> None:
    """The expected values are in test/data/packet_example_cpp_check.txt of mip_sdk."""
    (sample,) = sensor([*IMU, "delta_angle", "delta_velocity"]).feed(SENSOR_DATA, 0)
    assert sample.time_ns == 23_067_000_000
    assert sample.valid
    gravity = 9.80665
    expected = [0.077592 * gravity, 0.000061 * gravity, -0.979233 * gravity]
    assert sample.values["acceleration"] == pytest.approx(expected, abs=1e-5)
    assert sample.values["angular_velocity"] == pytest.approx(
        [-0.002138, -0.003283, -0.005192], abs=1e-6
    )


def test_channels_have_si_units() -> None:
    imu = sensor([*IMU, "magnetic_field", "pressure"])
    assert [(each.name, each.unit, each.shape) for each in imu.channels] == [
        ("acceleration", "m/s²", (3,)),
        ("angular_velocity", "rad/s", (3,)),
        ("magnetic_field", "T", (3,)),
        ("pressure", "Pa", ()),
    ]
    fields = [
        *(device.reference(1), device.vector(0x04, 0, 0, 0), device.vector(0x05, 0, 0, 0)),
        *(device.vector(0x06, 0.5, 0, 0), device.vector(0x17, 1013.25)),
    ]
    (sample,) = imu.feed(device.packet(0x80, *fields), 0)
    assert sample.values["magnetic_field"] == pytest.approx((5e-5, 0, 0))  # gauss to tesla
    assert sample.values["pressure"] == pytest.approx(101_325.0)  # mbar to Pa


def test_orientation_of_the_filter() -> None:
    ahrs = sensor(["quaternion", "filter_status"])
    quaternion = struct.pack(">4fH", 1, 0, 0, 0, 1)
    status = struct.pack(">3H", 3, 1, 0)
    fields = device.reference(5), (0x03, quaternion), (0x10, status)
    (sample,) = ahrs.feed(device.packet(0x82, *fields), 0)
    assert sample.values["quaternion"] == (1, 0, 0, 0)
    assert sample.values["filter_status"] == (3, 1, 0)


def test_values_that_the_device_marks_as_invalid() -> None:
    ahrs = sensor(["quaternion"])
    field = 0x03, struct.pack(">4fH", 1, 0, 0, 0, 0)
    (sample,) = ahrs.feed(device.packet(0x82, device.reference(5), field), 0)
    assert not sample.valid
    assert sample.reason == "the device marks quaternion as invalid"


def test_the_time_of_generation_5_is_that_of_gps() -> None:
    imu = sensor(["acceleration"], generation=5)
    fields = device.gps(1.5, 2), device.vector(0x04, 0, 0, 1)
    (sample,) = imu.feed(device.packet(0x80, *fields), 0)
    assert sample.time_ns == 2 * 604_800_000_000_000 + 1_500_000_000


@pytest.mark.parametrize("seconds", [math.nan, -1.0, math.inf, 1e9])
def test_an_impossible_time_of_the_week(seconds: float) -> None:
    imu = sensor(["acceleration"], generation=5)
    packet = device.packet(0x80, device.gps(seconds), device.vector(0x04, 0, 0, 1))
    assert imu.feed(packet, 0) == []
    assert imu.counters.bad_messages == 1


def test_missing_samples_are_counted() -> None:
    imu = sensor()
    for number in (0, 1, 2, 6, 7):
        assert len(imu.feed(device.imu(number * PERIOD_NS), 0)) == 1
    assert (imu.counters.samples, imu.counters.lost) == (5, 3)


def test_a_time_that_goes_back_is_passed_on_and_not_counted_as_lost() -> None:
    imu = sensor()
    times = [
        sample.time_ns
        for number in (100, 101, 5, 6)
        for sample in imu.feed(device.imu(number * PERIOD_NS), 0)
    ]
    assert times == [number * PERIOD_NS for number in (100, 101, 5, 6)]
    assert imu.counters.lost == 0


def test_packets_without_all_fields_are_no_samples() -> None:
    imu = sensor()
    assert imu.feed(device.packet(0x80, device.vector(0x04, 0, 0, 1)), 0) == []
    short = device.reference(1), device.vector(0x04, 0, 0), device.vector(0x05, 0, 0, 0)
    assert imu.feed(device.packet(0x80, *short), 0) == []
    assert imu.counters.bad_messages == 2
    assert imu.feed(device.packet(0x80, device.reference(1), (0x18, b"\0\0")), 0) == []
    assert imu.feed(device.packet(0x82, device.reference(1), (0x10, bytes(6))), 0) == []
    assert imu.counters.bad_messages == 2


def test_start_discards_half_a_packet() -> None:
    imu = sensor()
    packet = device.imu(0)
    imu.feed(packet[:20], 0)
    imu.start()
    assert len(imu.feed(packet[20:] + packet, 0)) == 1


def test_commands_of_generation_7() -> None:
    idle, rate, layout, stream, resume = sensor().start()
    # mip_sdk, test/data/packet_example_cpp_check.txt has this command for 100 Hz
    expected = bytes.fromhex("75650C0E0E0F018003D5000A04000A05000A91CE")
    assert Mip(IMU, rate=100.0).start()[2] == expected
    assert layout == device.packet(0x0C, (0x0F, bytes.fromhex("0180 03 D50002 040002 050002")))
    assert idle == device.packet(0x01, (0x02, b""))
    assert rate == device.packet(0x0C, (0x0E, b"\x80"))
    assert stream == device.packet(0x0C, (0x11, b"\x01\x80\x01"))
    assert resume == device.packet(0x01, (0x06, b""))


def test_commands_of_generation_5() -> None:
    """The golden bytes are in manual 8500-0064, sections 4.2.4 and 4.2.7."""
    _, rate, layout, stream, _ = sensor(generation=5).start()
    assert rate == bytes.fromhex("7565 0C02 0206 F0F7")
    assert stream == bytes.fromhex("7565 0C05 0511 0101 0104 1A")
    assert layout == device.packet(0x0C, (0x08, bytes.fromhex("01 03 120002 040002 050002")))
    _, rate, layout, stream, _ = sensor(["quaternion"], generation=5).start()
    assert rate == device.packet(0x0C, (0x0B, b""))
    assert layout == device.packet(0x0C, (0x0A, bytes.fromhex("01 02 110002 030002")))
    assert stream == device.packet(0x0C, (0x11, b"\x01\x03\x01"))


def test_a_refused_command_is_reported() -> None:
    imu = sensor()
    assert imu.feed(device.reply(0x0C, 0x0F, 0), 0) == []
    (sample,) = imu.feed(device.reply(0x0C, 0x0F, 3), 0)
    assert not sample.valid
    assert sample.reason == (
        "the device refused the command message format (0x0C, 0x0F): a parameter is invalid"
    )
    assert all(math.isnan(number) for number in sample.values["acceleration"])


def test_another_base_rate_is_reported() -> None:
    imu = sensor(generation=5)
    # manual 8500-0064, section 4.2.4: the reply with 100 Hz
    (sample,) = imu.feed(bytes.fromhex("7565 0C08 04F1 0600 0483 0064 D46B"), 0)
    assert sample.reason == "the base rate of the device is 100 Hz, not 1000 Hz"
    same = device.reply(0x0C, 0x06, 0, (0x83, struct.pack(">H", 1000)))
    assert imu.feed(same, 0) == []


@pytest.mark.parametrize(
    ("fields", "options", "message"),
    [
        (["acceleration", "heading"], {}, r"unknown MIP fields \['heading'\]"),
        (["acceleration", "quaternion"], {}, "only fields of one data set"),
        (["acceleration", "acceleration"], {}, "name each once"),
        ([], {}, "only fields of one data set"),
        (IMU, {"base_rate": 700.0}, "does not divide the base rate"),
        (IMU, {"base_rate": 100.0}, "does not divide the base rate"),
    ],
)
def test_arguments_that_cannot_work(fields, options, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sensor(fields, **options)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan])
def test_rates_that_cannot_work(rate: float) -> None:
    with pytest.raises(ValueError, match="does not divide"):
        Mip(IMU, rate=rate)


def test_the_table_has_each_descriptor_once() -> None:
    assert len({(each.descriptor_set, each.descriptor) for each in FIELDS.values()}) == len(FIELDS)


def test_a_ping_is_that_of_the_manual() -> None:
    assert commands.ping() == bytes.fromhex("7565 0102 0201 E0C6")
