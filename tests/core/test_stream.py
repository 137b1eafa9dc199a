"""Streams of set-points: one row per cycle, underruns, with a law, and after their end."""

import threading

import numpy as np
import pytest

from catenary.core import CYCLE_DRY, Stream
from catenary.plan.stop_reason import StopReason
from tests.core.rig import CSV, Bench, axis, bench
from tests.core.test_law import Frame, make_law

EXECUTION_MODES = ("threaded", "inline")


def rows(*positions: float) -> bytes:
    """For one axis."""
    return np.array([[p, 0.0, 0.0] for p in positions]).tobytes()


def streaming(execution: str, **more: object) -> tuple[Bench, Stream]:
    b = bench(axis(0, **more), execution=execution)
    b.enable()
    stream = Stream(1, 8)
    b.engine.set_stream(stream)
    return b, stream


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_one_row_a_cycle_whatever_python_writes(execution: str) -> None:
    b, stream = streaming(execution)
    assert stream.write(rows(0.001, 0.002, 0.003), b.engine.number) == 3
    seen = []
    for _ in range(3):
        b.target_position[:] = 9.0
        b.engine.next()
        seen.append(b.drives[0].target_position)
    assert seen == [1, 2, 3]
    assert stream.taken == 3
    assert stream.dry == 0


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_an_empty_stream_is_an_underrun_that_is_reported_and_ends(execution: str) -> None:
    b, stream = streaming(execution)
    b.steps(3)
    assert stream.dry == 0  # not begun: nothing was promised yet
    stream.write(rows(0.001), b.engine.number)
    b.steps(45)  # less than the late limit
    assert b.drives[0].target_position == 1
    assert b.drives[0].state == 4
    assert b.engine.next() & CYCLE_DRY
    assert stream.dry > 40
    counters = b.engine.counters
    assert (counters["underrun"], counters["uncommitted"]) == (stream.dry, 0)
    stream.write(rows(0.002), b.engine.number)
    b.steps(20)
    assert b.drives[0].target_position == 2
    b.steps(60)
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert b.drives[0].state == 1


def test_the_velocity_decreases_to_zero_on_an_empty_stream() -> None:
    b = bench(axis(0, mode=CSV, deceleration=10.0))
    b.ask(1)
    for _ in range(12):
        b.target_velocity[:] = 0.0
        b.engine.next()
    stream = Stream(1, 4)
    b.engine.set_stream(stream)
    stream.write(np.array([[0.0, 0.03, 0.0]]).tobytes(), b.engine.number)
    b.steps(1)
    assert b.drives[0].target_velocity == 30
    b.steps(5)
    assert b.drives[0].target_velocity == 0


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_law_finds_the_row_in_its_targets(execution: str) -> None:
    b, stream = streaming(execution)

    def mirror(frame: Frame) -> int:
        frame.target["position"][0] *= -1
        return 0

    b.engine.start_law(make_law(b, mirror))
    b.steps(2)
    stream.write(rows(0.005, 0.006), b.engine.number)
    b.steps(3)  # a law computes for the next cycle
    assert b.drives[0].target_position == -6


def test_the_application_continues_from_the_end_of_the_stream() -> None:
    b, stream = streaming("threaded")
    stream.write(rows(*np.linspace(0.001, 0.008, 8)), b.engine.number)
    b.engine.run(4)  # no application meanwhile: the stream goes on
    b.engine.set_stream(None)
    assert b.target_position[0] == pytest.approx(b.drives[0].target_position * 1e-3)
    b.steps(3)
    assert b.drives[0].state == 4


def test_bounded_and_validated() -> None:
    stream = Stream(2, 4)
    six = np.zeros((6, 6)).tobytes()
    assert stream.write(six, 0) == 4
    assert stream.write(six, 0) == 0
    assert stream.waiting == 4
    with pytest.raises(ValueError, match="6 numbers"):
        stream.write(b"\0" * 50, 0)
    with pytest.raises(ValueError, match="0 rows"):
        Stream(2, 0)
    b = bench(axis(0))
    with pytest.raises(ValueError, match="2 axes"):
        b.engine.set_stream(stream)


def test_no_row_is_torn_lost_or_doubled_between_two_threads() -> None:
    count = 5_000
    b, _ = streaming("threaded")
    stream = Stream(1, 500)
    b.engine.set_stream(stream)
    wanted = np.arange(1, count + 1) * 1e-6

    def fill() -> None:
        left = np.array([[p, p, p] for p in wanted])
        while len(left):
            left = left[stream.write(left[:50].tobytes(), b.engine.number) :]

    writer = threading.Thread(target=fill)
    writer.start()
    seen = []
    while stream.taken < count:
        before = stream.taken
        if not stream.waiting:
            continue
        b.engine.next()
        if stream.taken != before:
            seen.append(b.target_position[0])
    writer.join()
    assert np.allclose(seen, wanted[-len(seen) :])
    assert len(seen) == count


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_rows_written_before_an_axis_was_enabled_again_do_not_move_it(execution: str) -> None:
    """It would jump to the row of the moment. It follows what is written from then on."""
    b, stream = streaming(execution)
    stream.write(rows(*np.linspace(0.001, 0.008, 8)), b.engine.number)
    b.steps(2)
    b.drives[0].state = 1
    b.steps(1)
    b.enable()
    stood = b.drives[0].target_position
    b.steps(8)
    assert b.drives[0].state == 4
    assert b.drives[0].target_position == stood
    stream.write(rows(0.004), b.engine.number)
    b.steps(2)
    assert b.drives[0].target_position == 4
