"""Streams in a loop: a trajectory written ahead, by the iterating thread or another one."""

import threading

import numpy as np
import pytest

import catenary as cat


@pytest.fixture
def opened():
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=1e-3) as loop:
            yield arm, loop


def ramp(count: int) -> np.ndarray:
    """(count, 2) [rad]"""
    return np.linspace(0, 0.05, count)[:, None] * [1.0, -1.0]


def test_a_trajectory_written_ahead_is_followed_and_then_held(opened) -> None:
    arm, loop = opened
    stream = loop.stream(capacity=300)
    assert stream.write(ramp(300)) == 300
    assert (stream.waiting, stream.free) == (300, 0)
    dry_at = next(cycle.number for cycle in loop if cycle.dry)
    assert 298 <= dry_at <= 302
    for cycle in loop:
        assert cycle.dry
        if cycle.number == dry_at + 30:  # less than the late limit
            break
    assert 30 <= stream.dry <= 32
    stream.close()
    for cycle in loop:
        assert not cycle.dry
        if cycle.number == 600:
            break
    # The empty stream was continued for 10 cycles; the axes hold there.
    assert arm.actual.position == pytest.approx([0.05, -0.05], abs=2e-3)
    assert all(arm.enabled)


def test_another_thread_may_write(opened) -> None:
    arm, loop = opened
    stream = loop.stream(capacity=50)

    def fill() -> None:
        left = ramp(200)
        while len(left):
            left = left[stream.write(left[:20]) :]

    writer = threading.Thread(target=fill)
    writer.start()
    while writer.is_alive() or stream.waiting:
        if stream.waiting:  # an empty stream would be an underrun
            next(loop)
    writer.join()
    assert arm.target.position == pytest.approx([0.05, -0.05])


def test_invalid_rows_are_refused(opened) -> None:
    _, loop = opened
    stream = loop.stream()
    with pytest.raises(ValueError, match="rows of 2 axes"):
        stream.write([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="NaN"):
        stream.write([1.0, float("nan")])
    with pytest.raises(ValueError, match="none"):
        stream.write()
    with pytest.raises(ValueError, match="same number of rows"):
        stream.write(np.zeros((2, 2)), velocity=np.zeros((3, 2)))
    assert stream.write([0.0, 0.0]) == 1
