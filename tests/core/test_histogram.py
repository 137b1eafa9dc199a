"""Histograms, compared with NumPy on the raw values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.core._histogram import Histogram

PERCENTILES = {"p50": 50, "p99": 99, "p999": 99.9}


def filled(values: np.ndarray) -> Histogram:
    histogram = Histogram()
    for value in values.tolist():
        histogram.add(value)
    return histogram


@pytest.mark.parametrize("scale", [300, 5_000, 1_000_000, 3_000_000_000])
def test_figures_of_a_skewed_distribution(scale: int) -> None:
    values = np.random.default_rng(7).exponential(scale, 20_000).astype(np.int64)
    summary = filled(values).summary()
    assert summary["count"] == len(values)
    assert summary["mean"] == pytest.approx(values.mean() / 1e9, rel=1e-9)
    assert summary["sd"] == pytest.approx(values.std() / 1e9, rel=1e-6)
    assert summary["min"] == values.min() / 1e9
    assert summary["max"] == values.max() / 1e9
    for name, percent in PERCENTILES.items():
        expected = np.percentile(values, percent, method="nearest") / 1e9
        assert summary[name] == pytest.approx(expected, rel=0.004, abs=0.001)


def test_the_deviation_of_a_steady_period_survives_its_size() -> None:
    values = 1_000_000_000 + np.random.default_rng(1).integers(-5, 6, 10_000)
    assert filled(values).summary()["sd"] == pytest.approx(values.std() / 1e9, rel=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**40))
def test_a_value_is_in_its_bucket_and_buckets_are_narrow(value: int) -> None:
    [(lower, upper, count)] = filled(np.array([value])).counts()
    assert count == 1
    assert lower <= value / 1e9 < upper
    assert upper - lower <= max(0.001, 0.004 * lower) + 1e-9


def test_what_is_out_of_range_is_counted_at_the_ends() -> None:
    histogram = filled(np.array([-5, 2**60]))
    assert histogram.summary()["min"] == 0
    assert histogram.summary()["max"] == 2**60 / 1e9
    assert sum(count for *_, count in histogram.counts()) == 2


def test_an_empty_histogram_has_only_a_count() -> None:
    assert Histogram().summary() == {"count": 0}
    assert Histogram().counts() == []
