"""Motion of the demo: sines of 0.5 Hz with equal phase differences, and their recording."""

from __future__ import annotations

import math

import numpy as np

import catenary as cat
from catenary.bus import SubDevices
from catenary.demo.result import Motion
from catenary.demo.text import ProgressBar

PERIOD = 1e-3  # [s]
COUNTS_PER_TURN = 2**20
# The demo uses generous limits so that it runs on any machine: its virtual devices share the
# processors with the loop. Their pauses appear as lost and late cycles in the figures. Keep the
# defaults for real devices.
LOST_LIMIT = 800  # cycles
WATCHDOG = 1.0  # [s], of the devices
LATE_LIMIT = 0.5  # [s]
AMPLITUDE = math.pi  # [rad]
ANGULAR_FREQUENCY = math.pi  # [rad/s]
VELOCITY_LIMIT = 20.0  # [rad/s]; the sines reach 10 rad/s
FADE_IN = 1.0  # [s]; the amplitude grows during this time, so that the drives start from rest


def drives_of(subs: SubDevices) -> cat.Drives:
    return cat.Drives(
        subs.drives,
        mode="csp",
        counts_per_turn=COUNTS_PER_TURN,
        velocity_limit=VELOCITY_LIMIT,
    )


def follow(loop: cat.Loop, arm: cat.Drives, recording: Recording, progress: ProgressBar) -> None:
    """Move the drives until the recording is full."""
    home = arm.actual.position.copy()
    phases = np.arange(len(arm)) * (math.tau / len(arm))
    for cycle in loop:
        t = cycle.time
        growth = AMPLITUDE * min(t / FADE_IN, 1.0) ** 2
        reference = home + growth * np.sin(ANGULAR_FREQUENCY * t + phases)
        arm.target.position[:] = reference
        if not recording.add(t, reference, arm.actual.position):
            return
        progress.show(t)


class Recording:
    """Recorded reference and actual positions [rad], one row per cycle.

    The arrays are allocated in advance, so that each cycle needs only two small copies.
    """

    def __init__(self, seconds: float, drives: int) -> None:
        rows = max(round(seconds / PERIOD), 1)
        self._time = np.zeros(rows)
        self._reference = np.zeros((rows, drives))
        self._actual = np.zeros((rows, drives))
        self._used = 0

    def add(self, time: float, reference: np.ndarray, actual: np.ndarray) -> bool:
        """Add a row. Return False if it was the last free row.

        Args:
            time: Time of the cycle [s].
            reference: Target positions, shape (drives,) [rad].
            actual: Actual positions, shape (drives,) [rad].
        """
        row = self._used
        self._time[row] = time
        self._reference[row] = reference
        self._actual[row] = actual
        self._used = row + 1
        return self._used < len(self._time)

    def __len__(self) -> int:
        return self._used

    def motion(self) -> Motion:
        used = slice(self._used)
        return Motion(self._time[used], self._reference[used], self._actual[used])
