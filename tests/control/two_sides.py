"""Two devices of one axis, coupled over a delay line: a continuous plant under sampled torques."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

PERIOD, STEPS = 1e-3, 10
Torque = Callable[[float, float, float], float]  # of time, position and velocity → N·m


def free(time: float, position: float, velocity: float) -> float:
    return 0.0


@dataclass
class Side:
    """Inertia that is moved by a torque of its controller and a torque from outside."""

    inertia: float = 2e-3
    outside: Torque = free
    position: float = 0.0
    velocity: float = 0.0
    applied: float = 0.0
    positions: list[float] = field(default_factory=list)
    waiting: float = 0.0  # torque of the previous step, which acts from the next cycle on

    def step(self, time: float, torque: float) -> None:
        """Advance by a period. `torque` acts one period later, as with a law."""
        self.applied, self.waiting = self.waiting, torque
        dt = PERIOD / STEPS
        for _ in range(STEPS):
            total = self.applied + self.outside(time, self.position, self.velocity)
            self.velocity += dt * total / self.inertia
            self.position += dt * self.velocity
        self.positions.append(self.position)


class Delay:
    """Line that returns the newest value that has arrived, and its age [periods]."""

    def __init__(self, ages: Callable[[], int], first: object) -> None:
        self.ages, self.newest, self.stamp = ages, first, -1
        self.flying: deque[tuple[int, int, object]] = deque()

    def step(self, now: int, value: object) -> object:
        """Send a value at the period `now`; a negative age loses it. Return the newest arrival."""
        age = self.ages()
        if age >= 0:
            self.flying.append((now + age, now, value))
        for arrival, stamp, each in self.flying:
            if arrival <= now and stamp > self.stamp:
                self.stamp, self.newest = stamp, each
        self.flying = deque(each for each in self.flying if each[0] > now)
        return self.newest


def constant(periods: int) -> Callable[[], int]:
    return lambda: periods


def lossy(longest: int, loss: float, seed: int) -> Callable[[], int]:
    """Return random ages up to `longest`, and -1 with the probability `loss`."""
    random = np.random.default_rng(seed)
    return lambda: -1 if random.random() < loss else int(random.integers(0, longest + 1))
