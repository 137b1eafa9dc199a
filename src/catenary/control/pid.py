"""PID controller with anti-windup, output limit and rate limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

KIND = 1.0
GAINS = 7  # proportional, integral, derivative, derivative_time, limit, rate, 1/tracking_time
STATES = 5  # initialised, integral part, previous measured value, derivative part, previous output


@dataclass(frozen=True)
class Pid:
    """Settings of a PID controller; each option is one value, or one per axis.

    The unit of `proportional` is that of the output divided by that of the input. From position to
    velocity it is 1/s. From velocity to torque, `proportional` has N·m·s/rad, `integral` N·m/rad
    and `derivative` N·m·s²/rad.

    Args:
        axes: number of axes.
        proportional: proportional gain.
        integral: integral gain.
        derivative: derivative gain, applied to the measured value.
        limit: largest output, in both directions.
        rate: largest change of the output per second.
        derivative_time: time constant of the low-pass of the derivative [s].
        tracking_time: time constant of the anti-windup [s]; None for proportional / integral, or
            for no anti-windup if `integral` is 0.

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.

    Source: Åström and Murray, Feedback Systems, ch. 11 (PID control, anti-windup by
    back-calculation, computer implementation). The derivative uses backward differences.
    """

    axes: int
    proportional: PerAxis
    integral: PerAxis = 0.0
    derivative: PerAxis = 0.0
    limit: PerAxis = math.inf
    rate: PerAxis = math.inf
    derivative_time: PerAxis = 0.0
    tracking_time: PerAxis | None = None

    def __post_init__(self) -> None:
        _ = self.parameters  # validates the values

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 7 · axes,)."""
        return table(KIND, *self.columns())

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (5 · axes,)."""
        return np.zeros(STATES * self.axes)

    def columns(self) -> list[Row]:
        """Return the gains and limits, each (axes,), in the order of the parameters."""
        n = axis_count(self.axes)
        names = ("proportional", "integral", "derivative", "derivative_time")
        first = [checked(name, getattr(self, name), n) for name in names]
        bounds = [checked(name, getattr(self, name), n, above=True) for name in ("limit", "rate")]
        if self.tracking_time is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                tracking = np.where(first[1] > 0, first[1] / first[0], 0.0)
        else:
            tracking = 1.0 / checked("tracking_time", self.tracking_time, n, above=True)
        return [*first, *bounds, tracking]


@compiles
def pid(
    memory: Row,
    parameters: Row,
    i: int,
    reference: float,
    measured: float,
    feed_forward: float,
    dt: float,
) -> float:
    """Compute one step of axis `i`.

    Args:
        memory: `Pid.memory`.
        parameters: `Pid.parameters`.
        i: number of the axis.
        reference: target value.
        measured: measured value.
        feed_forward: value to add to the output. The limits apply to the sum. The rate limit of the
            first step starts from this value.
        dt: time since the previous step [s].

    Returns:
        Output.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("pid: not the parameters of a Pid")
    return pid_step(
        memory,
        STATES * i,
        parameters,
        1 + GAINS * i,
        reference,
        measured,
        feed_forward,
        feed_forward,
        dt,
    )


@compiles
def pid_step(
    memory: Row,
    m: int,
    parameters: Row,
    p: int,
    reference: float,
    measured: float,
    feed_forward: float,
    begin: float,
    dt: float,
) -> float:
    """Compute one step with the state that starts at `memory[m]` and the gains at `parameters[p]`.

    `begin` is the output before the first step. The rate limit of the first step starts from it.
    """
    # Python's own floats are several times faster than NumPy's; float() is free in compiled code.
    measured, limit = float(measured), float(parameters[p + 4])
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = 0.0
        memory[m + 2] = measured
        memory[m + 3] = 0.0
        memory[m + 4] = limited(float(begin), limit)
    error, before = float(reference) - measured, float(memory[m + 4])
    integral, low_pass_time = float(memory[m + 1]), float(parameters[p + 3])
    change = float(parameters[p + 2]) * (measured - float(memory[m + 2]))
    derivative = (low_pass_time * float(memory[m + 3]) - change) / (low_pass_time + dt)
    unlimited = float(feed_forward) + float(parameters[p]) * error + integral + derivative
    step = float(parameters[p + 5]) * dt
    output = min(max(limited(unlimited, limit), before - step), before + step)
    tracking = min(float(parameters[p + 6]) * dt, 1.0)
    integral += float(parameters[p + 1]) * error * dt + (output - unlimited) * tracking
    memory[m + 1] = integral
    memory[m + 2] = measured
    memory[m + 3] = derivative
    memory[m + 4] = output
    return output


@compiles
def limited(value: float, limit: float) -> float:
    """Return `value`, clamped to ± `limit`."""
    return min(max(value, -limit), limit)
