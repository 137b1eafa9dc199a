"""Two networks in real time, each with a native thread."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.loop.networks import cpus_for
from catenary.virtual import Coupler, Segment, Servo

CYCLES = 200


def test_each_network_has_its_own_thread() -> None:
    """Nothing is said of how timely: only that both exchange, follow, and come down."""
    segments = [Segment([Coupler(), Servo(), Servo()], clock="monotonic") for _ in range(2)]
    with cat.MainDevice(segments[0]) as first, cat.MainDevice(segments[1]) as second:
        upper, lower = (
            cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            for main in (first, second)
        )
        with cat.Loop(
            upper,
            lower,
            period=2e-3,
            stop=cat.StopPolicy(lost_limit=1_000_000, late_limit=0, raise_faults=False),
            watchdog=0,
        ) as loop:
            for cycle in loop:
                upper.target.position[:] = 0.05
                lower.target.position[:] = -0.05
                if cycle.number >= CYCLES:
                    break
            origins = {network.session.engine.origin % 2_000_000 for network in loop.networks}
            assert len(origins) == 1  # one grid of instants
            assert all(network.timing.counters["cycles"] >= CYCLES for network in loop.networks)
            assert (upper.target.position > 0).all()
            assert upper.actual.position[0] > -0.01 > lower.actual.position[0]
    assert all(device.state & 0x0F == 1 for segment in segments for device in segment)


def test_cpus() -> None:
    assert cpus_for(2, 1) == [1, 1]
    assert cpus_for(2, [2, 3]) == [2, 3]
    assert cpus_for(1, None) == [None]
    with pytest.raises(ValueError, match="2 networks"):
        cpus_for(2, [1])


@pytest.mark.parametrize("cpu", [[1], np.int64(1), 1.0])
def test_one_network_takes_one_cpu_as_an_integer(cpu: Any) -> None:
    with pytest.raises(ValueError, match="one network has one thread"):
        cpus_for(1, cpu)


def test_cpus_are_the_last_where_there_are_more_than_networks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1, 2, 3})
    assert cpus_for(2, None) == [2, 3]
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    assert cpus_for(2, None) == [None, None]
