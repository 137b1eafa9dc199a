"""Delay line for laws, to test control loops and predictors with a known delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import axis_count, computed_once

KIND = 15.0
STATES = 2  # initialised, place of the oldest value; then the values


@dataclass(frozen=True)
class Delay:
    """Settings of a delay line, which returns the value of an earlier step.

    Args:
        axes: number of axes.
        steps: delay in steps, one number, or one per axis; 0 passes the value through. Multiply by
            the period to get the delay in seconds.

    Raises:
        ValueError: A delay is negative or not a whole number, or the number of values is wrong.

    A law has at most 4096 numbers of memory, which limits axes · (2 + largest delay).
    """

    axes: int
    steps: int | Sequence[int]

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (2 + axes,): the width of the memory of an axis, the delays."""
        steps = self._steps()
        return np.concatenate([[KIND, STATES + max(steps)], steps]).astype(np.float64)

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (axes · (2 + largest delay),)."""
        return np.zeros(self.axes * (STATES + max(self._steps())))

    def _steps(self) -> list[int]:
        n = axis_count(self.axes)
        steps = np.array(self.steps)
        if steps.ndim > 1 or steps.size not in (1, n):
            raise ValueError(
                f"steps has shape {steps.shape}; give one value, or one for each of {n} axes"
            )
        for i, value in enumerate(np.broadcast_to(steps, (n,)).tolist()):
            if not (isinstance(value, int) and value >= 0):
                raise ValueError(
                    f"steps of axis {i} is {value!r}; it must be a whole number of at least 0"
                )
        return [int(value) for value in np.broadcast_to(steps, (n,))]


@compiles
def delay(memory: Row, parameters: Row, i: int, value: float) -> float:
    """Compute one step of axis `i`.

    Args:
        memory: `Delay.memory`.
        parameters: `Delay.parameters`.
        i: number of the axis.
        value: value to delay.

    Returns:
        Value of the step `steps` before; the first value until then.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("delay: not the parameters of a Delay")
    steps = int(parameters[2 + i])
    if steps == 0:
        return value
    m = int(parameters[1]) * i
    if memory[m] == 0.0:
        memory[m] = 1.0
        for k in range(steps):
            memory[m + STATES + k] = value
    place = int(memory[m + 1])
    oldest: float = memory[m + STATES + place]
    memory[m + STATES + place] = value
    memory[m + 1] = place + 1 if place + 1 < steps else 0
    return oldest
