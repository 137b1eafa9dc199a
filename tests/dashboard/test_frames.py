"""Binary frames: every sample, and minima and maxima that keep each peak."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.dashboard.frames import (
    encode_decimated,
    encode_full,
    extremes,
    find_columns,
)
from catenary.share import ShareLayout
from tests.dashboard.serving import decode_frame

DTYPE = np.dtype([("number", "<u8"), ("scheduled_ns", "<i8"), ("x", "<f8", (3,)), ("odd[1]", "u1")])
FIELDS = [SimpleNamespace(name=n, shape=DTYPE[n].shape) for n in DTYPE.names or ()]
LAYOUT = cast(ShareLayout, SimpleNamespace(name="test", fields=FIELDS))
floats = st.floats(allow_nan=True, allow_infinity=True, width=32)


def rows_of(values: list[float]) -> np.ndarray:
    rows = np.zeros(len(values), DTYPE)
    rows["number"] = 7 + np.arange(len(values))
    rows["scheduled_ns"] = 1_000_000 * np.arange(len(values))
    rows["x"][:, 1] = values
    rows["odd[1]"] = 5
    return rows


def test_a_field_of_two_dimensions_has_no_signals() -> None:
    field = SimpleNamespace(name="matrix", shape=(3, 3))
    layout = cast(ShareLayout, SimpleNamespace(name="test", fields=[field]))
    for signal in ("matrix", "matrix[0]"):
        with pytest.raises(ValueError, match="no signal"):
            find_columns(layout, [signal])


@given(st.lists(floats, min_size=1, max_size=50))
def test_a_full_frame_has_every_sample(values: list[float]) -> None:
    columns = find_columns(LAYOUT, ["x[1]", "odd[1]"])
    frame = decode_frame(
        encode_full(rows_of(values), columns, 3, 1e-3).for_subscription(9, dropped=2)
    )
    assert (frame.kind, frame.id, frame.rows, frame.lost, frame.first) == (1, 9, len(values), 5, 7)
    np.testing.assert_array_equal(frame.values[0], values)
    np.testing.assert_array_equal(frame.values[1], 5.0)
    np.testing.assert_allclose(frame.time, 1e-3 * np.arange(len(values)))


@given(st.lists(floats, min_size=1, max_size=50))
def test_a_decimated_frame_keeps_each_peak(values: list[float]) -> None:
    columns = find_columns(LAYOUT, ["x[1]"])
    frame = decode_frame(encode_decimated(rows_of(values), columns, 0, 1e-3).for_subscription(1))
    known = [value for value in values if value == value]
    low, high = frame.values[0, 0]
    if known:
        assert (low, high) == (min(known), max(known))
    else:
        assert np.isnan(low)
        assert np.isnan(high)


def test_integers_have_extremes() -> None:
    assert extremes(np.array([3, 1, 2], np.uint8)) == (1.0, 3.0)


@pytest.mark.parametrize(
    "signal",
    ["", "y", "x", "x[3]", "x[-1]", "x[1", "number[0]", "x[1]\n", "x[99999999]", "x[1][0]"],
)
def test_unknown_signals_are_refused(signal: str) -> None:
    with pytest.raises(ValueError, match="no signal"):
        find_columns(LAYOUT, [signal])


@given(st.text(max_size=20))
def test_any_text_is_a_signal_or_refused(signal: str) -> None:
    try:
        ((name, index),) = find_columns(LAYOUT, [signal])
    except ValueError:
        return
    assert name in (DTYPE.names or ())
    assert index is None or index < 3
