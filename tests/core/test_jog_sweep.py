"""Frequency sweeps in the core: generator, limits, dead-man (core/_sweep.pxd, core/_jog.pyx)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.plan.cycle import AxisLimits
from catenary.share.jog import JogStatus
from tests.core.operator import Operator
from tests.core.rig import CSP, CSV, Bench
from tests.core.test_jog import PV, A, D, T, V, commanded, made, velocity_of

COUNT = 1e-3  # resolution of the rig [rad and rad/s]
Values = npt.NDArray[np.float64]


def swept(b: Bench, operator: Operator, cycles: int) -> Values:
    """Run cycles with heartbeats. Return the velocities of the commanded positions [rad/s]."""
    path = [commanded(b)]
    for _ in range(cycles):
        operator.beat()
        b.engine.next()
        path.append(commanded(b))
    return np.diff(path) / T


def ideal(amplitude: float, start: float, end: float, duration: float, cycles: int) -> Values:
    """Sweep without limits, computed in another way: phase of the closed form."""
    times = np.arange(cycles) * T
    rate = math.log(end / start) / duration
    turns = start * times if rate == 0 else start * np.expm1(rate * times) / rate
    edge = np.clip(np.minimum(times, duration - times) / 0.1, 0.0, 1.0)
    return amplitude * edge * np.sin(2 * math.pi * turns)


def shifted(seen: Values, expected: Values) -> Values:
    """Return the part of `seen` that begins with the motion, as long as the expected one."""
    first = int(np.flatnonzero(seen)[0]) - int(np.flatnonzero(expected)[0])
    return seen[first : first + len(expected)]


# ---- the generator


@pytest.mark.parametrize(
    ("amplitude", "start", "end"), [(0.1, 1.0, 10.0), (-0.1, 10.0, 1.0), (0.05, 5.0, 5.0)]
)
def test_a_sweep_is_a_sine_of_changing_frequency(
    amplitude: float, start: float, end: float
) -> None:
    b, operator = made()
    operator.press(amplitude, sweep=(start, end, 1.5))
    seen = swept(b, operator, 1600)
    expected = ideal(amplitude, start, end, 1.5, 1501)
    assert shifted(seen, expected) == pytest.approx(expected, abs=1e-6)
    assert operator.status() is JogStatus.DONE
    assert b.jogged[0] == 0
    assert not seen[-50:].any()


@pytest.mark.parametrize("mode", [CSV, PV])
def test_a_velocity_mode_commands_the_sweep(mode: int) -> None:
    b, operator = made(mode)
    operator.press(0.2, sweep=(2.0, 4.0, 0.5))
    seen = []
    for _ in range(600):
        operator.beat()
        b.engine.next()
        seen.append(velocity_of(b))
    expected = ideal(0.2, 2.0, 4.0, 0.5, 500)
    assert max(seen) == pytest.approx(expected.max(), abs=COUNT)
    assert min(seen) == pytest.approx(expected.min(), abs=COUNT)
    assert operator.status() is JogStatus.DONE


def test_the_amplitude_falls_where_the_acceleration_limits_it() -> None:
    b, operator = made()
    operator.press(0.5, sweep=(1.0, 50.0, 2.0))
    seen = swept(b, operator, 2100)
    assert np.abs(seen[:1000]).max() == pytest.approx(0.5, rel=0.05)  # 1 to 7 Hz
    assert np.abs(np.diff(seen)).max() <= A * T * (1 + 1e-6)
    near_end = np.abs(seen[1850:1900]).max()  # 37 to 42 Hz
    assert near_end == pytest.approx(A / (2 * math.pi * 40), rel=0.1)
    assert operator.status() is JogStatus.DONE


def test_a_second_sweep_begins_anew() -> None:
    b, operator = made()
    first = ideal(0.1, 1.0, 10.0, 0.5, 501)
    for _ in range(2):
        operator.press(0.1, sweep=(1.0, 10.0, 0.5))
        assert shifted(swept(b, operator, 600), first) == pytest.approx(first, abs=1e-6)


def test_a_press_after_a_sweep_has_constant_velocity() -> None:
    b, operator = made()
    operator.press(0.1, sweep=(1.0, 10.0, 0.5))
    swept(b, operator, 600)
    operator.press(0.3)
    assert swept(b, operator, 300)[-1] == pytest.approx(0.3)


@pytest.mark.parametrize(
    "sweep",
    [
        (0.0, 1.0, 1.0),
        (1.0, 0.0, 1.0),
        (-1.0, 1.0, 1.0),
        (math.nan, 1.0, 1.0),
        (1.0, math.nan, 1.0),
        (1.0, 1.0, math.nan),
        (1.0, 1.0, 0.1),
        (1.0, 1.0, -1.0),
        (1.0, 1.0, math.inf),
        (1.0, math.inf, 1.0),
        (1.0, 500.0, 1.0),  # half of the cycle rate
        (500.0, 1.0, 1.0),
        (1e-300, 1.0, 1.0),
    ],
)
def test_invalid_sweeps_are_refused(sweep: tuple[float, float, float]) -> None:
    b, operator = made()
    operator.press(0.1, sweep=sweep)
    assert not swept(b, operator, 20).any()
    assert operator.status() is JogStatus.REFUSED_INVALID


def test_a_sweep_with_a_distance_is_refused() -> None:
    b, operator = made()
    operator.press(0.1, 0.1, sweep=(1.0, 2.0, 1.0))
    assert not swept(b, operator, 20).any()
    assert operator.status() is JogStatus.REFUSED_INVALID


# ---- its ends


def test_a_released_sweep_ramps_to_standstill() -> None:
    b, operator = made()
    operator.press(0.5, sweep=(1.0, 1.0, 10.0))
    before = swept(b, operator, 250)[-1]
    operator.release()
    after = swept(b, operator, 60)
    assert before > 0.4
    assert np.abs(np.diff([before, *after])).max() <= D * T * (1 + 1e-6)
    assert not after[-20:].any()
    assert operator.status() is JogStatus.RELEASED


@pytest.mark.parametrize("mode", [CSP, CSV, PV])
def test_a_sweep_without_heartbeats_expires(mode: int) -> None:
    b, operator = made(mode)
    operator.press(0.5, sweep=(2.0, 20.0, 10.0))
    swept(b, operator, 100)
    b.steps(260)
    assert operator.status() is JogStatus.EXPIRED
    assert b.jogged[0] == 0
    at = b.drives[0].target_position
    operator.beat()
    b.steps(100)
    assert (b.drives[0].target_position, velocity_of(b)) == (at, 0.0)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 0.05), (-1.0, 0.0)])
def test_a_position_limit_ends_a_sweep(low: float, high: float) -> None:
    b, operator = made(limits=AxisLimits(velocity=V, position_min=low, position_max=high))
    operator.press(0.5, sweep=(0.5, 5.0, 5.0))
    swept(b, operator, 1500)
    assert operator.status() is JogStatus.AT_LIMIT
    assert b.jogged[0] == 0
    assert commanded(b) == pytest.approx(high, abs=0.02)


@settings(max_examples=150, deadline=None)
@given(
    velocity=st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-3),
    acceleration=st.one_of(st.just(math.nan), st.floats(0.5, 100.0)),
    start=st.floats(1e-3, 499.0),
    end=st.floats(1e-3, 499.0),
    duration=st.floats(0.2, 2.0),
    until=st.integers(0, 1500),
    ending=st.sampled_from(["release", "none", "press", "sweep"]),
    low=st.floats(-1.0, -1e-6),
    high=st.floats(0.0, 1.0),
)
def test_no_sweep_exceeds_a_limit(
    velocity: float,
    acceleration: float,
    start: float,
    end: float,
    duration: float,
    until: int,
    ending: str,
    low: float,
    high: float,
) -> None:
    b, operator = made(limits=AxisLimits(velocity=V, position_min=low, position_max=high))
    operator.press(velocity, acceleration=acceleration, sweep=(start, end, duration))
    speeds = [swept(b, operator, until)]
    if ending == "release":
        operator.release()
    elif ending == "press":
        operator.press(velocity)
    elif ending == "sweep":
        operator.press(velocity, acceleration=acceleration, sweep=(end, start, duration))
    path = [commanded(b)]
    for _ in range(500):
        b.engine.next()
        path.append(commanded(b))
    speed = np.concatenate([[0.0], *speeds, np.diff(path) / T])
    position = np.cumsum(speed) * T
    assert b.jogged[0] == 0
    assert np.abs(speed).max() <= V * (1 + 1e-6)
    assert np.abs(np.diff(speed)).max() <= D * T * (1 + 1e-6)
    assert position.min() >= low - 1e-9
    assert position.max() <= high + 1e-9
    assert path[-1] == path[-100]


@settings(max_examples=100, deadline=None)
@given(
    velocity=st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-3),
    acceleration=st.floats(0.5, 100.0),
    start=st.floats(1e-3, 499.0),
    end=st.floats(1e-3, 499.0),
    duration=st.floats(0.2, 1.0),
)
def test_a_complete_sweep_keeps_its_acceleration(
    velocity: float, acceleration: float, start: float, end: float, duration: float
) -> None:
    b, operator = made()
    operator.press(velocity, acceleration=acceleration, sweep=(start, end, duration))
    speed = swept(b, operator, round(duration / T) + 50)
    assert operator.status() is JogStatus.DONE
    assert np.abs(np.diff(speed)).max() <= min(acceleration, A) * T * (1 + 1e-6)
    assert np.abs(speed).max() <= min(abs(velocity), V) * (1 + 1e-6)
