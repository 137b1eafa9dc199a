"""Serial port as a source of a sensor.

    source = SerialPort("/dev/ttyACM0", 115_200)

The port is opened for exclusive use, without flow control, with 8 data bits, no parity and one
stop bit. If the baud rate is wrong, bytes arrive, but no message: the runner then makes the sensor
invalid with the advice to check it. If the device is unplugged, the runner opens the port again.
Name the port by /dev/serial/by-id, because /dev/ttyACM0 may have another number afterwards.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import termios
import time
from typing import Any

from catenary.sensors.extra import require

READ_SIZE = 4096  # [bytes] size of the kernel's buffer of a port
WRITE_TIMEOUT = 1.0  # [s]
REASONS = {
    errno.EAGAIN: "another program uses the port",
    errno.EACCES: "Permission denied: run `sudo usermod -aG dialout $USER`, and log in again",
}


class SerialPort:
    """Serial port of one device.

    Args:
        path: path of the port, such as "/dev/serial/by-id/...".
        baud_rate: bits per second [1/s]. Ports of USB devices, such as ttyACM, ignore it.
        low_latency: True to set ASYNC_LOW_LATENCY where the driver has it. FTDI's driver then
            passes on received bytes after 1 ms instead of 16 ms.

    Raises:
        ValueError: The baud rate is not positive.
    """

    def __init__(self, path: str, baud_rate: int = 115_200, *, low_latency: bool = True) -> None:
        if baud_rate <= 0:
            raise ValueError(f"baud_rate={baud_rate}: must be positive")
        self._path, self._baud_rate, self._low_latency = path, baud_rate, low_latency

    @property
    def name(self) -> str:
        """Path and baud rate of the port."""
        return f"{self._path} at {self._baud_rate} baud"

    def open(self) -> SerialConnection:
        """Open the port, and discard bytes that it has received before.

        Raises:
            ConfigurationError: pyserial is not installed.
            OSError: The port does not exist, is in use or refuses the baud rate.
        """
        serial = require("serial", "pyserial")
        try:
            port = serial.Serial(
                self._path, self._baud_rate, exclusive=True, write_timeout=WRITE_TIMEOUT
            )
        except (termios.error, ValueError) as error:
            raise OSError(errno.EINVAL, f"the port refuses its settings: {error}") from error
        except OSError as error:
            raise port_error(error) from error
        if self._low_latency:
            with contextlib.suppress(ValueError):  # ttyACM and pseudo terminals do not have it
                port.set_low_latency_mode(True)
        return SerialConnection(port)


class SerialConnection:
    """Owner of an open serial port."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._poll = select.poll()
        self._poll.register(port.fileno(), select.POLLIN)

    def read(self, timeout: float) -> tuple[bytes, int]:
        """Return the received bytes and the time of reception [ns]; no bytes after `timeout` [s].

        Raises OSError if the device was unplugged.
        """
        ready = self._poll.poll(timeout * 1e3)
        data = os.read(self._port.fileno(), READ_SIZE) if ready else b""
        if ready and not data:
            raise OSError(errno.ENODEV, "the device was unplugged")
        return data, time.monotonic_ns()

    def write(self, data: bytes) -> None:
        """Send bytes. Raises OSError if the device was unplugged, or does not take them."""
        self._port.write(data)

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(OSError):  # the device was unplugged
            self._port.close()


def port_error(error: OSError) -> OSError:
    """Return an error without the path and number, which pyserial repeats in its text."""
    number = error.errno
    return OSError(number, REASONS.get(number) or os.strerror(number)) if number else error
