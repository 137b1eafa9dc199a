"""Second-order Butterworth low-pass."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

KIND = 4.0
COEFFICIENTS = 5  # b0, b1, b2, a1, a2
STATES = 3  # initialised, two states of the transposed direct form II


@dataclass(frozen=True)
class LowPass:
    """Settings of a second-order Butterworth low-pass.

    Args:
        axes: number of axes.
        cutoff: frequency at which the gain is -3 dB [Hz], one value or one per axis.
        period: time between two steps [s].

    Raises:
        ValueError: A value is out of range, for example a cutoff of half the sample rate or more.

    Source: the Butterworth polynomial s² + √2 s + 1, discretized by the bilinear transform with a
    prewarped frequency, K = tan(π cutoff period). Oppenheim and Schafer, Discrete-Time Signal
    Processing, §7.2.
    """

    axes: int
    cutoff: PerAxis
    period: float

    def __post_init__(self) -> None:
        _ = self.parameters  # validates the values

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 5 · axes,)."""
        if not self.period > 0:
            raise ValueError(f"period={self.period} s must be positive")
        cutoff = checked("cutoff", self.cutoff, axis_count(self.axes), above=True)
        for i in np.flatnonzero(cutoff * self.period >= 0.5).tolist():
            raise ValueError(
                f"cutoff of axis {i} is {cutoff[i]:g} Hz; it must be below half the sample rate, "
                f"{0.5 / self.period:g} Hz"
            )
        k = np.tan(math.pi * cutoff * self.period)
        norm = 1 / (1 + math.sqrt(2) * k + k * k)
        b = k * k * norm
        a = 2 * (k * k - 1) * norm, (1 - math.sqrt(2) * k + k * k) * norm
        return table(KIND, b, 2 * b, b, *a)

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (3 · axes,). The first step initialises the filter."""
        return np.zeros(STATES * self.axes)


@compiles
def low_pass(memory: Row, parameters: Row, i: int, value: float) -> float:
    """Return the next output of axis `i`, in the unit of `value`.

    Args:
        memory: `LowPass.memory`.
        parameters: `LowPass.parameters`.
        i: number of the axis.
        value: input.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("low_pass: not the parameters of a LowPass")
    m, p = STATES * i, 1 + COEFFICIENTS * i
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = value * (1.0 - parameters[p])
        memory[m + 2] = value * (parameters[p + 2] - parameters[p + 4])
    output: float = parameters[p] * value + memory[m + 1]
    memory[m + 1] = parameters[p + 1] * value - parameters[p + 3] * output + memory[m + 2]
    memory[m + 2] = parameters[p + 2] * value - parameters[p + 4] * output
    return output
