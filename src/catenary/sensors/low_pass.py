"""Low-pass filters: Butterworth of order 1 or 2, by the bilinear transform with pre-warping.

Source of the formulas: Oppenheim and Schafer, Discrete-Time Signal Processing, section 7.2.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class LowPass:
    """Owner of the state of a filter for numbers or arrays of one shape.

    The first value after `reset` is the steady state. At low frequencies, the delay is about
    0.16 / cutoff [s] for order 1, and 0.23 / cutoff for order 2.

    Args:
        cutoff: frequency at which the gain is -3 dB [Hz].
        rate: samples per second [Hz].
        order: 1 or 2.

    Raises:
        ValueError: the cutoff is not between 0 and half of the rate, or the order is unknown.
    """

    def __init__(self, cutoff: float, rate: float, *, order: int = 2) -> None:
        if not 0 < cutoff < rate / 2 or not math.isfinite(rate):
            raise ValueError(f"cutoff={cutoff} Hz: must be between 0 and {rate / 2} Hz")
        if order not in (1, 2):
            raise ValueError(f"order={order}: must be 1 or 2")
        self._b, self._a = coefficients(math.tan(math.pi * cutoff / rate), order)
        self._state: tuple[Array, Array] | None = None

    def step(self, value: npt.ArrayLike) -> Array:
        """Return the filtered value, in the shape of `value`."""
        given = np.asarray(value, np.float64)
        (b0, b1, b2), (a1, a2) = self._b, self._a
        if self._state is None:
            self._state = (b1 - a1 + b2 - a2) * given, (b2 - a2) * given
        first, second = self._state
        result: Array = b0 * given + first
        self._state = b1 * given - a1 * result + second, b2 * given - a2 * result
        return result

    def reset(self) -> None:
        """Begin again with the next value."""
        self._state = None


def coefficients(
    warped: float, order: int
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """Return the numerator and the denominator (without its leading 1) of a filter.

    Args:
        warped: tan(π · cutoff / rate).
        order: 1 or 2.
    """
    if order == 1:
        gain = warped / (1.0 + warped)
        return (gain, gain, 0.0), ((warped - 1.0) / (warped + 1.0), 0.0)
    square, root = warped * warped, math.sqrt(2.0) * warped
    scale = 1.0 / (1.0 + root + square)
    gain = square * scale
    return (gain, 2.0 * gain, gain), (2.0 * (square - 1.0) * scale, (1.0 - root + square) * scale)
