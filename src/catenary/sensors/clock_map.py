"""Mapping of the clock of a device to CLOCK_MONOTONIC.

Each message arrives after its measurement by an unknown delay, which is never negative. So the
smallest difference between time of reception and time of the device is the best estimate of the
offset between both clocks. The estimate follows a smaller difference at once. It rises only by the
largest expected drift of the device, so that delayed messages hardly change it. The mapped time is
therefore never later than the reception. Data that waits in a buffer keeps its old time.

The smallest delay itself cannot be measured from one side, and remains as a constant error.
"""

from __future__ import annotations

from dataclasses import dataclass

DRIFT = 500e-6  # largest expected difference of the rates of both clocks
JUMP_NS = 100_000_000  # a device that runs ahead of the reception by more has a new time


@dataclass(slots=True)
class ClockMap:
    """Owner of the estimated offset between the clock of a device and CLOCK_MONOTONIC.

    Args:
        drift: largest expected difference of the rates of both clocks, as a ratio.
    """

    drift: float = DRIFT
    _offset_ns: float | None = None
    _device_ns: int = 0  # of the last sample
    _mapped_ns: int = 0

    def map(self, device_ns: int, received_ns: int) -> int | None:
        """Return the time of a sample on CLOCK_MONOTONIC [ns].

        None: the time of the device went back or jumped ahead. The estimate begins again with this
        sample. Mapped times never go back.

        Args:
            device_ns: time of the measurement on the clock of the device.
            received_ns: time of reception on CLOCK_MONOTONIC.
        """
        difference = received_ns - device_ns
        if self._offset_ns is None:
            self._offset_ns = float(difference)
        elif device_ns < self._device_ns or difference < self._offset_ns - JUMP_NS:
            self._offset_ns, self._device_ns = float(difference), device_ns
            return None
        else:
            rise = (device_ns - self._device_ns) * self.drift
            self._offset_ns = min(self._offset_ns + rise, float(difference))
        self._device_ns = device_ns
        self._mapped_ns = max(self._mapped_ns, device_ns + round(self._offset_ns))
        return self._mapped_ns

    def restart(self) -> None:
        """Forget the offset, after a silence of the device. Mapped times still never go back."""
        self._offset_ns = None
