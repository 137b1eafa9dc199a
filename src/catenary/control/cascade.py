"""Cascaded position and velocity control: from a position [rad] to a torque [N·m]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import computed_once, table
from catenary.control.pid import GAINS, STATES, Pid, pid_step

KIND = 2.0


@dataclass(frozen=True)
class Cascade:
    """Settings of a cascade: a position controller whose output is the input of a velocity loop.

        Cascade(Pid(6, 20.0, limit=2.6), Pid(6, 40.0, integral=200.0, limit=[430, 430, 200, ...]))

    Args:
        position: controller from position to velocity [rad/s]. Its `limit` is the velocity limit
            of the joint, its `rate` the acceleration limit [rad/s²].
        velocity: controller from velocity to torque [N·m]. Its `limit` is the torque limit, its
            `rate` the largest change of the torque [N·m/s].

    Raises:
        ValueError: The two controllers differ in the number of axes.
    """

    position: Pid
    velocity: Pid

    def __post_init__(self) -> None:
        if self.position.axes != self.velocity.axes:
            raise ValueError(
                f"the position controller has {self.position.axes} axes, "
                f"the velocity controller has {self.velocity.axes}"
            )

    @property
    def axes(self) -> int:
        """Number of axes."""
        return self.position.axes

    @property
    @computed_once
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
    """Compute one step of axis `i`.

    The rate limits of the first step start from the measured velocity and from `feed_forward`. When
    the brake opens, the torque therefore already balances gravity.

    Args:
        memory: `Cascade.memory`.
        parameters: `Cascade.parameters`.
        i: number of the axis.
        goal: target position [rad].
        goal_velocity: velocity of the target [rad/s].
        feed_forward: torque for gravity, friction and inertia [N·m]. The torque limit applies to
            the sum.
        position: measured position [rad].
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Torque [N·m].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("cascade: not the parameters of a Cascade")
    m = 2 * STATES * i
    p = 1 + 2 * GAINS * i
    reference = pid_step(memory, m, parameters, p, goal, position, goal_velocity, velocity, dt)
    return pid_step(
        memory,
        m + STATES,
        parameters,
        p + GAINS,
        reference,
        velocity,
        feed_forward,
        feed_forward,
        dt,
    )
