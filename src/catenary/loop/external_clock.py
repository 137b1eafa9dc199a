"""External clock of a loop: a PTP hardware clock, a clock of the kernel, or a clock of the program.

Cycles that follow PTP need the time of a PTP hardware clock (PHC) or CLOCK_TAI, which has no leap
seconds: https://github.com/robert-burger/libethercat/pull/25. The pairs of readings are those of an
external EtherCAT synchronisation, here within one machine:
https://infosys.beckhoff.com/content/1033/tf6225_tc3_ethercat_external_sync/3623206539.html.
"""

from __future__ import annotations

import errno
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from catenary.errors import ClockError
from catenary.loop.clock_discipline import BOUND, RATE_LIMIT, ClockSample

KERNEL_CLOCKS = {"CLOCK_TAI": time.CLOCK_TAI, "CLOCK_REALTIME": time.CLOCK_REALTIME}
FIND = "`ethtool -T NIC` shows the PTP hardware clock of a network card"
ACCESS = 'run as root, or add a udev rule: SUBSYSTEM=="ptp", GROUP="...", MODE="0640"'
CLOCKFD = 3  # FD_TO_CLOCKID in clock_gettime(2): the descriptor, inverted, and these three bits
READINGS = 5  # attempts per sample; the shortest one counts
WINDOW_NS = 100_000  # longest usable reading; a longer one was interrupted


@runtime_checkable
class TimeSource(Protocol):
    """Clock that a program provides."""

    def time_ns(self) -> int:
        """Return the time [ns]. Raise OSError if the clock does not answer.

        It is called in a thread of the loop, and must return within 100 us.
        """


@dataclass(frozen=True, slots=True)
class ExternalClock:
    """Clock that the cycle starts of a loop follow: `ClockOptions(external=...)`.

    Args:
        source: Path of a PTP hardware clock such as "/dev/ptp0", "CLOCK_TAI", "CLOCK_REALTIME", or
            an object with a method `time_ns`.
        phase: Delay of the cycle starts, or of SYNC0 with distributed clocks, after the multiples
            of the period in the time of the clock [s].
        rate_limit: Largest relative change of a period, at most 1e-3. 1e-6 is 1 ppm.
        within: Phase error that counts as locked [s].

    Raises:
        ValueError: An option is impossible.
        TypeError: `source` is neither a name nor a clock.
    """

    source: str | TimeSource
    phase: float = 0.0
    rate_limit: float = RATE_LIMIT
    within: float = BOUND

    def __post_init__(self) -> None:
        if not isinstance(self.source, str | TimeSource):
            raise TypeError(
                f"source={self.source!r}: must be a path, a clock name or a clock with time_ns()"
            )
        if isinstance(self.source, str):
            require_name("source", self.source)
        if not math.isfinite(self.phase):
            raise ValueError(f"phase={self.phase} s: must be finite")
        if not 0 < self.rate_limit <= 1e-3:
            raise ValueError(f"rate_limit={self.rate_limit}: must be positive, at most 1e-3")
        if not 0 < self.within < math.inf:
            raise ValueError(f"within={self.within} s: must be positive and finite")

    @property
    def name(self) -> str:
        """Name of the clock for messages."""
        return self.source if isinstance(self.source, str) else type(self.source).__name__

    def open(self) -> TimeSource:
        """Return the clock, opened.

        Raises:
            ClockError: The device cannot be opened or read.
        """
        if not isinstance(self.source, str):
            return self.source
        if self.source in KERNEL_CLOCKS:
            return KernelClock(KERNEL_CLOCKS[self.source])
        return HardwareClock(self.source)


class KernelClock:
    """Clock of the kernel, by its number."""

    def __init__(self, number: int) -> None:
        self._number = number

    def time_ns(self) -> int:
        """Return the time [ns]."""
        return time.clock_gettime_ns(self._number)


class HardwareClock:
    """PTP hardware clock. It owns the descriptor of the device.

    Args:
        path: Device, such as "/dev/ptp0".

    Raises:
        ClockError: The device cannot be opened or read.
    """

    def __init__(self, path: str) -> None:
        try:
            self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            hint = ACCESS if error.errno == errno.EACCES else FIND
            raise ClockError(f"{path}: {error.strerror}", hint=hint) from error
        try:
            self.time_ns()
        except OSError as error:
            self.close()
            raise ClockError(
                f"{path} is not a PTP hardware clock: {error.strerror}",
                hint=FIND,
            ) from error

    def time_ns(self) -> int:
        """Return the time [ns]. Raise OSError if the device has gone."""
        return time.clock_gettime_ns((~self._descriptor << 3) | CLOCKFD)

    def close(self) -> None:
        """Close the device; a second call has no effect."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def read_sample(
    source: TimeSource, now_ns: Callable[[], int], cycle_start_ns: Callable[[], int]
) -> ClockSample | None:
    """Read both clocks several times and return the most accurate pair.

    Args:
        source: External clock.
        now_ns: Function that returns the time of the link's clock [ns].
        cycle_start_ns: Function that returns the newest cycle start on that clock [ns].

    Returns:
        Sample; None if the clock does not answer, or if each reading was interrupted.
    """
    best, shortest = None, WINDOW_NS + 1
    for _ in range(READINGS):
        before = now_ns()
        try:
            external = source.time_ns()
        except OSError:
            return None
        window = now_ns() - before
        if window < shortest:
            middle = before + window // 2
            best, shortest = (middle, external - middle), window
    return None if best is None else ClockSample(*best, cycle_start_ns())


def require_name(option: str, source: str) -> None:
    """Raise ValueError unless a text is the path of a clock or the name of a kernel's clock.

    Args:
        option: Name of the option for the error message.
        source: Path or name.
    """
    if source not in KERNEL_CLOCKS and not source.startswith("/"):
        names = ", ".join(f'"{name}"' for name in KERNEL_CLOCKS)
        raise ValueError(f'{option}={source!r}: must be a path such as "/dev/ptp0", or {names}')
