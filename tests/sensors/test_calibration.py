from __future__ import annotations

import numpy as np
import pytest

from catenary.sensors import Calibration

NAN = float("nan")


def test_the_bias_is_subtracted_before_the_matrix():
    calibration = Calibration([[2.0, 0.0], [0.0, 10.0], [1.0, 1.0]], bias=[1.0, 2.0])
    assert calibration.apply([2.0, 3.0]).tolist() == [2.0, 10.0, 2.0]


def test_a_tared_sensor_shows_zero_without_load():
    noise = np.random.default_rng(1).normal([0.3, -0.7], 0.01, (1000, 2))
    calibration = Calibration(np.eye(2)).tare(noise)
    assert calibration.apply(noise.mean(axis=0)) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert calibration.bias == pytest.approx([0.3, -0.7], abs=2e-3)


@pytest.mark.parametrize("samples", [np.zeros((0, 2)), np.zeros((5, 3)), np.zeros(2), [[1.0, NAN]]])
def test_samples_that_do_not_fit_are_refused(samples):
    with pytest.raises(ValueError, match="must be"):
        Calibration(np.eye(2)).tare(samples)


@pytest.mark.parametrize(
    ("matrix", "bias"),
    [([1.0, 2.0], None), (np.zeros((0, 2)), None), (np.eye(2), [1.0]), ([[NAN]], None)],
)
def test_a_calibration_that_does_not_fit_is_refused(matrix, bias):
    with pytest.raises(ValueError, match="must be"):
        Calibration(matrix, bias)
