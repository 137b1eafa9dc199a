"""Frames of a CAN bus, on python-can's virtual bus."""

from __future__ import annotations

import os
import struct
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import ConfigurationError, DecodeError
from catenary.sensors.can import Can, CanBus, CanMessage, CanSignal
from catenary.sensors.can_dbc import dbc_message
from catenary.sensors.can_frame import CanFrame, decode_frame, encode_frame
from catenary.sensors.sensor import Channel

FORCE = CanMessage(0x1A0, "<hhh", [CanSignal(Channel("force", "N", (3,)), 0.01)])
TORQUE = CanMessage(0x1A1, "<hhhx", [CanSignal(Channel("torque", "N·m", (3,)), 0.001, 1.0)])
PERIOD_NS = 2_000_000


def wrist() -> Can:
    return Can([FORCE, TORQUE], rate=500.0)


def linux_frame(identifier: int, data: bytes) -> bytes:
    """Return the bytes of `struct can_frame` of linux/can.h without the unused data."""
    return struct.pack("<IBBBB", identifier, len(data), 0, 0, 0) + data


def test_a_sample_has_one_message_of_each_identifier() -> None:
    sensor = wrist()
    assert sensor.feed(linux_frame(0x1A1, struct.pack("<hhhx", 0, 0, 500)), 0) == []
    assert sensor.feed(linux_frame(0x200, b"other"), 0) == []
    (sample,) = sensor.feed(linux_frame(0x1A0, struct.pack("<hhh", 100, -100, 0)), 1)
    assert sample.values["force"] == pytest.approx((1.0, -1.0, 0.0))
    assert sample.values["torque"] == pytest.approx((1.0, 1.0, 1.5))
    assert sample.time_ns is None


def test_a_lost_message_is_counted() -> None:
    sensor = wrist()
    force = linux_frame(0x1A0, bytes(6))
    torque = linux_frame(0x1A1, bytes(7))
    assert sensor.feed(force, 0) == []
    assert sensor.feed(force, 1) == []  # the torque between is lost
    assert len(sensor.feed(torque, 2)) == 1
    assert sensor.counters.lost == 1


def test_parts_of_different_periods_are_not_combined() -> None:
    sensor = wrist()
    assert sensor.feed(linux_frame(0x1A0, bytes(6)), 0) == []
    assert sensor.feed(linux_frame(0x1A1, bytes(7)), PERIOD_NS + 1) == []
    assert sensor.counters.lost == 1


def test_another_length_and_other_kinds_of_frames() -> None:
    sensor = Can([FORCE], rate=500.0)
    assert sensor.feed(linux_frame(0x1A0, bytes(5)), 0) == []
    assert sensor.counters.bad_messages == 1
    assert sensor.feed(linux_frame(0x1A0 | 0x4000_0000, b""), 0) == []  # remote
    assert sensor.feed(linux_frame(0x1A0 | 0x8000_0000, bytes(6)), 0) == []  # 29 bits
    assert sensor.feed(linux_frame(0x4 | 0x2000_0000, bytes(8)), 0) == []  # error
    assert sensor.counters.bad_messages == 2
    assert len(sensor.feed(linux_frame(0x1A0, bytes(6)), 0)) == 1


def test_bus_off_makes_the_sensor_invalid() -> None:
    """CAN_ERR_FLAG and CAN_ERR_BUSOFF of linux/can/error.h."""
    (sample,) = wrist().feed(linux_frame(0x2000_0040, bytes(8)), 0)
    assert (sample.valid, sample.reason) == (False, "the CAN controller is bus-off")


def test_frames_that_start_and_stop_the_device() -> None:
    """CANopen's NMT commands (CiA 301): identifier 0, command 1 or 2, node 5."""
    sensor = Can(
        [FORCE], rate=500.0, start=[CanFrame(0, b"\x01\x05")], stop=[CanFrame(0, b"\x02\x05")]
    )
    assert list(sensor.start()) == [linux_frame(0, b"\x01\x05")]
    assert list(sensor.stop()) == [linux_frame(0, b"\x02\x05")]


@given(st.integers(0, 0x7FF), st.binary(max_size=64), st.booleans(), st.booleans())
def test_frames_keep_their_content(number: int, data: bytes, extended: bool, remote: bool) -> None:
    frame = CanFrame(number, data, extended, remote)
    assert decode_frame(encode_frame(frame)) == frame


@given(st.binary(max_size=80))
def test_any_bytes_are_a_frame_or_an_error(data: bytes) -> None:
    sensor = wrist()
    sensor.feed(data, 0)
    try:
        frame = decode_frame(data)
    except DecodeError:
        assert sensor.counters.bad_messages == 1
    else:
        assert len(frame.data) == len(data) - 8


@pytest.mark.parametrize(
    "make",
    [
        lambda: CanMessage(0x1A0, "<hh", [CanSignal(Channel("force", "N", (3,)))]),
        lambda: CanMessage(0x1A0, "<3s", [CanSignal(Channel("force", "N"))]),
        lambda: CanMessage(0x800, "<h", [CanSignal(Channel("force", "N"))]),
        lambda: Can([FORCE, FORCE], rate=1.0),
        lambda: Can([], rate=1.0),
        lambda: Can([FORCE], rate=0.0),
        lambda: encode_frame(CanFrame(1, bytes(65))),
    ],
)
def test_arguments_that_cannot_work(make) -> None:
    with pytest.raises(ValueError, match=r"numbers|identifier|positive"):
        make()


def test_frames_of_a_virtual_bus() -> None:
    library = pytest.importorskip("can")
    channel = f"catenary-{os.getpid()}"
    sensor = wrist()
    with library.Bus(interface="virtual", channel=channel) as device:
        connection = CanBus(channel, "virtual", ids=[0x1A0, 0x1A1]).open()
        before_ns = time.monotonic_ns()
        for identifier, size in ((0x300, 1), (0x1A0, 6), (0x1A1, 7)):
            message = library.Message(
                arbitration_id=identifier, data=bytes(size), is_extended_id=False
            )
            device.send(message)
        received = [connection.read(1.0) for _ in range(2)]
        samples = [each for item in received for each in sensor.feed(*item)]
        assert len(samples) == 1
        assert all(before_ns - 1_000_000 <= at <= time.monotonic_ns() for _, at in received)
        assert connection.read(0.0)[0] == b""
        connection.write(encode_frame(CanFrame(0x7, b"\x01")))
        answer = device.recv(1.0)
        assert (answer.arbitration_id, bytes(answer.data)) == (0x7, b"\x01")
        connection.write(encode_frame(CanFrame(0x7, bytes(12))))
        assert device.recv(1.0).is_fd
        connection.close()


def test_an_interface_that_does_not_exist() -> None:
    pytest.importorskip("can")
    with pytest.raises(OSError, match="nonsense"):
        CanBus("x", "nonsense").open()
    with pytest.raises(OSError, match=r".+"):
        CanBus("catenary-none").open()


DBC = """VERSION ""
NS_ :
BS_:
BU_: HOST
BO_ 419 Wrist: 4 HOST
 SG_ Fx : 0|16@1- (0.5,1) [0|0] "N" HOST
 SG_ Mode : 16|8@1+ (1,0) [0|0] "" HOST
BO_ 420 Multi: 2 HOST
 SG_ Kind M : 0|8@1+ (1,0) [0|0] "" HOST
 SG_ Value m0 : 8|8@1+ (1,0) [0|0] "" HOST
VAL_ 419 Mode 1 "on" 0 "off" ;
"""


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    pytest.importorskip("cantools")
    path = tmp_path / "wrist.dbc"
    path.write_text(DBC)
    return path


def test_a_message_of_a_dbc_file(dbc: Path) -> None:
    message = dbc_message(dbc, "Wrist")
    assert [(each.name, each.unit) for each in message.channels] == [("Fx", "N"), ("Mode", "")]
    sensor = Can([message], rate=100.0)
    (sample,) = sensor.feed(linux_frame(419, struct.pack("<hBx", -4, 1)), 0)
    assert sample.values == {"Fx": -1.0, "Mode": 1.0}
    assert sensor.feed(linux_frame(419, b"\0"), 0) == []


def test_dbc_files_that_cannot_be_used(dbc: Path) -> None:
    with pytest.raises(ConfigurationError, match="no message 'Ankle'"):
        dbc_message(dbc, "Ankle")
    with pytest.raises(ConfigurationError, match="multiplexed"):
        dbc_message(dbc, "Multi")
    with pytest.raises(ConfigurationError, match=r"missing\.dbc"):
        dbc_message(dbc.with_name("missing.dbc"), "Wrist")
    dbc.write_text("nothing of this kind")
    with pytest.raises(ConfigurationError, match=r"wrist\.dbc"):
        dbc_message(dbc, "Wrist")
