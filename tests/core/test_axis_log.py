"""Values of the axes in the log: one row per record, with its cycle number."""

from __future__ import annotations

import numpy as np
import pytest

from catenary.core import AXIS_FIELDS, RECORD_FIELDS
from tests.core.rig import Bench, axis, bench

RECORD, AXIS = np.dtype(RECORD_FIELDS), np.dtype(AXIS_FIELDS)


def rows(b: Bench, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """The records (cycles,) and their axes (cycles, axes)."""
    both = np.dtype([("record", RECORD), ("axes", AXIS, (axes,))])
    found = np.frombuffer(b.engine.log(), both)
    return found["record"], found["axes"]


def test_an_axis_takes_80_bytes() -> None:
    assert AXIS.itemsize == 80


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_each_record_is_followed_by_its_axes(execution: str) -> None:
    b = bench(axis(0), axis(1), execution=execution, log_axes=True)
    b.steps(3)
    record, axes = rows(b, 2)
    assert record["number"].tolist() == list(range(1, b.engine.number + 1))
    assert axes["actual.position"][-1] == pytest.approx(b.actual_position)
    assert axes["statusword"][-1].tolist() == b.engine.buffers["statusword"].tolist()
    assert axes["state"][-1].tolist() == b.engine.buffers["axis_state"].tolist()


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_targets_are_those_of_the_frames_that_brought_the_values(execution: str) -> None:
    b = bench(axis(0), execution=execution, log_axes=True)
    b.enable()
    sent = []
    for step in range(1, 6):
        b.target_position[0] = step * 1e-3
        b.engine.next()
        sent.append(step * 1e-3)
    _, axes = rows(b, 1)
    assert axes["target.position"][-5:, 0] == pytest.approx(sent)
    assert axes["commanded.position"][-5:, 0] == pytest.approx(sent)


def test_old_rows_are_overwritten_with_their_records() -> None:
    b = bench(axis(0), execution="inline", log_axes=True, log_cycles=50)
    b.engine.run(500)
    record, axes = rows(b, 1)
    assert record["number"].tolist() == list(range(451, 501))
    assert len(axes) == 50


def test_without_it_the_log_has_records_only() -> None:
    b = bench(axis(0), execution="inline")
    b.engine.run(10)
    assert len(b.engine.log()) == 10 * RECORD.itemsize


def test_a_plan_without_axes_logs_records_only() -> None:
    b = bench(execution="inline", units=1, log_axes=True)
    b.engine.run(10)
    assert len(b.engine.log()) == 10 * RECORD.itemsize
