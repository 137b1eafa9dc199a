"""PID with anti-windup, limit and rate limit: the block that a cascade is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, table

KIND = 1.0
GAINS = 7  # proportional, integral, derivative, derivative_time, limit, rate, 1/tracking_time
STATES = 5  # begun, integral part, measured before, derivative part, output before


@dataclass(frozen=True)
class Pid:
    """A PID controller for each of `axes` axes; every option is one value, or one for each.

    Units are the output's over the input's: from position to velocity `proportional` is [1/s];
    from velocity to torque `proportional` is [N·m·s/rad], `integral` [N·m/rad], `derivative`
    [N·m·s²/rad]. `limit`: of the output, both ways; `rate`: of its change a second;
    `derivative_time` [s]: of the derivative's low-pass; `tracking_time` [s]: in which the integral
    gives way while the output is limited (None: proportional / integral).

    Source: Åström and Murray, Feedback Systems, ch. 11 (PID control, anti-windup by
    back-calculation, computer implementation); the derivative is of the measured value, by
    backward differences.
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
        _ = self.parameters  # wrong values are found where they are written

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 7 · axes,)."""
        return table(KIND, *self.columns())

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (5 · axes,)."""
        return np.zeros(STATES * self.axes)

    def columns(self) -> list[Row]:
        """Return the gains, each (axes,)."""
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
    """Compute one step of axis `i`; the output includes `feed_forward`. `dt` [s]."""
    if parameters[0] != KIND:
        raise ValueError("pid: these are not the parameters of a Pid")
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
    """Run one step with the state from `memory[m]` on and the gains from `parameters[p]` on.

    `begin` is the output before the first step.
    """
    # float(): Python's own numbers are several times faster than NumPy's; compiled it is nothing
    measured, limit = float(measured), float(parameters[p + 4])
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = 0.0
        memory[m + 2] = measured
        memory[m + 3] = 0.0
        memory[m + 4] = limited(float(begin), limit)
    error, before = float(reference) - measured, float(memory[m + 4])
    integral, slowness = float(memory[m + 1]), float(parameters[p + 3])
    change = float(parameters[p + 2]) * (measured - float(memory[m + 2]))
    derivative = (slowness * float(memory[m + 3]) - change) / (slowness + dt)
    wanted = float(feed_forward) + float(parameters[p]) * error + integral + derivative
    step = float(parameters[p + 5]) * dt
    output = min(max(limited(wanted, limit), before - step), before + step)
    tracking = min(float(parameters[p + 6]) * dt, 1.0)
    integral += float(parameters[p + 1]) * error * dt + (output - wanted) * tracking
    memory[m + 1] = integral
    memory[m + 2] = measured
    memory[m + 3] = derivative
    memory[m + 4] = output
    return output


@compiles
def limited(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
