"""The simulated device of the benchmark sends what the decoder expects."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.sensors import RATE, figures, packet
from catenary.sensors import Mip


def test_the_packets_of_the_device_are_decoded() -> None:
    imu = Mip(["acceleration", "angular_velocity"], rate=RATE)
    imu.start()
    (sample,) = imu.feed(packet(123_000_000), 0)
    assert sample.time_ns == 123_000_000
    assert sample.values["acceleration"] == pytest.approx([0.0, 0.0, 9.80665])
    assert imu.counters.garbage == imu.counters.bad_checksums == 0


def test_the_figures_are_percentiles() -> None:
    assert figures(np.arange(101.0)) == {"p50": 50.0, "p99": 99.0, "max": 100.0}
