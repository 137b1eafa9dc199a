"""Cascaded position and velocity control: from a position [rad] to a torque [N·m]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import table
from catenary.control.pid import GAINS, STATES, Pid, pid_step

KIND = 2.0


@dataclass(frozen=True)
class Cascade:
    """Two PIDs for each axis, one in the other: `position` says a velocity [rad/s], its `limit` is
    the joint's velocity limit, its `rate` the acceleration limit [rad/s²]; `velocity` says the
    torque [N·m], its `limit` is the torque limit, its `rate` [N·m/s].

        Cascade(Pid(6, 20.0, limit=2.6), Pid(6, 40.0, integral=200.0, limit=[430, 430, 200, ...]))
    """

    position: Pid
    velocity: Pid

    def __post_init__(self) -> None:
        if self.position.axes != self.velocity.axes:
            raise ValueError(
                f"position has {self.position.axes} axes, velocity has {self.velocity.axes}"
            )

    @property
    def axes(self) -> int:
        return self.position.axes

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 14 · axes,)."""
        return table(KIND, *self.position.columns(), *self.velocity.columns())

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (10 · axes,)."""
        return np.zeros(2 * STATES * self.axes)


@compiles
def cascade(
    memory: Row,
    parameters: Row,
    i: int,
    goal: float,
    goal_velocity: float,
    feed_forward: float,
    position: float,
    velocity: float,
    dt: float,
) -> float:
    """One step of axis `i`: the torque [N·m] towards `goal` [rad] that moves with `goal_velocity`
    [rad/s], `feed_forward` [N·m] (gravity, friction, inertia) within the torque's limits.

    The first step has no jump to limit: it begins at the present velocity and at `feed_forward`, so
    that a brake opens onto the full gravity torque.
    """
    if parameters[0] != KIND:
        raise ValueError("cascade: these are not the parameters of a Cascade")
    m = 2 * STATES * i
    p = 1 + 2 * GAINS * i
    wanted = pid_step(memory, m, parameters, p, goal, position, goal_velocity, velocity, dt)
    return pid_step(
        memory,
        m + STATES,
        parameters,
        p + GAINS,
        wanted,
        velocity,
        feed_forward,
        feed_forward,
        dt,
    )
