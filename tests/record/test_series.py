"""Series for plots, on recordings with known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from catenary.record.layout import Field, Layout
from catenary.record.recording import Recording
from catenary.record.series import (
    largest,
    prefix_for,
    reference_of,
    rms,
    thin,
    timing_us,
    tracking_error,
    with_gaps,
)
from tests.record.made import make_layout, make_rows


def make_recording(axes: int = 2, count: int = 100) -> Recording:
    layout = make_layout(axes)
    return Recording(layout, make_rows(layout, count), (), 0, "the loop ended")


def test_rms_and_largest_ignore_nan() -> None:
    values = np.array([[3.0, np.nan, np.nan], [-4.0, 2.0, np.nan]])
    assert rms(values) == pytest.approx([np.sqrt(12.5), 2.0, 0.0])
    assert largest(values) == pytest.approx([4.0, 2.0, 0.0])


def test_tracking_error_is_reference_minus_actual() -> None:
    recording = make_recording()
    error = tracking_error(recording, "commanded_position")
    assert error == pytest.approx(recording["commanded_position"] - recording["position"])
    assert tracking_error(recording, None) is None
    assert tracking_error(recording, "target_position") is None


def test_the_default_reference_needs_a_drive_in_csp() -> None:
    recording = make_recording()
    assert reference_of(recording) == "commanded_position"  # the mode was not recorded
    fields = (*recording.layout.fields, Field("mode", "|i1", (2,), per_axis=True))
    layout = Layout("x", 1e-3, recording.axes, fields)
    rows = np.zeros(3, layout.dtype)
    rows["mode"] = 10  # CST
    torque = Recording(layout, rows, (), 0, "")
    assert reference_of(torque) is None
    rows["mode"][1, 0] = 8  # CSP, once
    assert reference_of(replace(torque, rows=rows)) == "commanded_position"


def test_timing_leaves_out_unknown_phases() -> None:
    recording = make_recording(0, 4)
    recording.rows["receive_ns"] = [1000, -1, 1000, 1000]
    recording.rows["process_ns"] = [2000, 2000, -1, 2000]
    recording.rows["send_ns"] = 500
    assert timing_us(recording, "in_controller") == pytest.approx([3.5, 3.5])
    assert timing_us(recording, "receive") == pytest.approx([1.0, 1.0, 1.0])
    assert timing_us(recording, "round_trip") is None
    recording.rows["send_ns"] = -1
    assert timing_us(recording, "send") is None


def test_lost_cycles_interrupt_a_line() -> None:
    recording = make_recording(1, 10)
    recording.rows["number"][4:] += 7
    time, values = with_gaps(recording, recording["position"])
    assert np.flatnonzero(np.isnan(time)).tolist() == [4]
    assert np.isnan(values[4]).all()
    assert np.array_equal(np.delete(values, 4, axis=0), recording["position"])


def test_thinning_keeps_extremes_and_gaps() -> None:
    time = np.arange(100_000.0)
    values = np.zeros((100_000, 2))
    values[54_321, 1] = 7.0
    values[70_000:72_000] = np.nan
    thinned_time, thinned = thin(time, values, 500)
    assert thinned.shape == (1000, 2)
    assert np.nanmax(thinned[:, 1]) == 7.0
    assert np.isnan(thinned).any()
    assert (np.diff(thinned_time) >= 0).all()
    assert thin(time[:100], values[:100], 500)[1].shape == (100, 2)


@pytest.mark.parametrize(
    ("top", "prefix"),
    [(0.0, ""), (12.0, ""), (0.4, ""), (0.04, "m"), (3e-4, "m"), (3e-5, "µ"), (1e-12, "n")],
)
def test_the_prefix_fits_the_largest_value(top: float, prefix: str) -> None:
    assert prefix_for(np.array([0.0, -top, np.nan]))[1] == prefix
