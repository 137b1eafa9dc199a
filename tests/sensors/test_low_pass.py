"""scipy judges the filters."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from catenary.sensors import LowPass

RATE = 500.0


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cutoff", [0.5, 20.0, 240.0])
def test_a_filter_equals_that_of_scipy(order, cutoff):
    values = np.random.default_rng(1).normal(size=(300, 3)).cumsum(axis=0) + 5.0
    b, a = signal.butter(order, cutoff, fs=RATE)
    steady = signal.lfilter_zi(b, a)[:, None] * values[0]
    expected, _ = signal.lfilter(b, a, values, axis=0, zi=steady)
    low_pass = LowPass(cutoff, RATE, order=order)
    found = np.array([low_pass.step(value) for value in values])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_the_first_value_is_the_steady_state_also_after_a_reset():
    low_pass = LowPass(5.0, RATE)
    assert [float(low_pass.step(3.0)) for _ in range(3)] == pytest.approx([3.0] * 3)
    low_pass.reset()
    assert float(low_pass.step(-1.0)) == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("cutoff", "rate", "order"),
    [(0.0, RATE, 2), (250.0, RATE, 2), (float("nan"), RATE, 2), (1.0, float("inf"), 1), (1, 9, 3)],
)
def test_a_filter_out_of_range_is_refused(cutoff, rate, order):
    with pytest.raises(ValueError, match="must be"):
        LowPass(cutoff, rate, order=order)
