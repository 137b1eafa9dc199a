"""Serial port, as a pseudo terminal. The runner uses it in test_imu.py."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator

import pytest

from catenary.errors import ConfigurationError
from catenary.sensors.serial_port import SerialPort
from tests.sensors import mip_device as device


@pytest.fixture
def pair() -> Iterator[tuple[int, str]]:
    """Side of the device as a file descriptor, and the path of the port."""
    pytest.importorskip("serial")
    master, slave = os.openpty()
    try:
        yield master, os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


def test_bytes_arrive_unchanged(pair: tuple[int, str]) -> None:
    """All 256 values: no line discipline may change or interpret them."""
    master, path = pair
    connection = SerialPort(path).open()
    sent = bytes(range(256)) + device.imu(1)
    before_ns = time.monotonic_ns()
    os.write(master, sent)
    received = b""
    while len(received) < len(sent):
        data, received_ns = connection.read(5.0)
        assert data
        received += data
    assert received == sent
    assert before_ns <= received_ns <= time.monotonic_ns()
    connection.write(b"\x00\r\nue\x03")
    assert os.read(master, 100) == b"\x00\r\nue\x03"
    connection.close()


def test_no_bytes_after_the_time_out(pair: tuple[int, str]) -> None:
    connection = SerialPort(pair[1]).open()
    assert connection.read(0.0)[0] == b""
    connection.close()


def test_bytes_from_before_the_opening_are_discarded(pair: tuple[int, str]) -> None:
    SerialPort(pair[1]).open().close()  # the terminal no longer edits lines
    os.write(pair[0], b"old")
    connection = SerialPort(pair[1]).open()
    os.write(pair[0], b"new")
    assert connection.read(5.0)[0] == b"new"
    connection.close()


def test_the_port_is_exclusive(pair: tuple[int, str]) -> None:
    connection = SerialPort(pair[1]).open()
    with pytest.raises(OSError, match="another program uses the port"):
        SerialPort(pair[1]).open()
    connection.close()
    SerialPort(pair[1]).open().close()


def test_an_unplugged_device() -> None:
    pytest.importorskip("serial")
    master, slave = os.openpty()
    path = os.ttyname(slave)
    connection = SerialPort(path).open()
    os.close(slave)
    os.close(master)
    with pytest.raises(OSError, match=r"unplugged|Input/output"):
        connection.read(5.0)
    with pytest.raises(OSError, match=r".+"):
        connection.write(b"x")
    connection.close()
    connection.close()
    with pytest.raises(OSError, match=r"\] No such file or directory$"):
        SerialPort(path).open()


def test_a_missing_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(ConfigurationError, match="needs pyserial") as caught:
        SerialPort("/dev/null").open()
    assert caught.value.hint == "pip install 'catenary[sensors]'"


def test_settings_that_cannot_work(pair: tuple[int, str]) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        SerialPort(pair[1], 0)
    with pytest.raises(OSError, match=r".+"):
        SerialPort("/dev/null").open()
