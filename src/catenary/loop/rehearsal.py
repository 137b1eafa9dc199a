"""A small calculation just before the instant of an inline cycle.

After a millisecond asleep the interpreter, NumPy and the arrays of the loop have left the caches of
the processor; the first calculation then takes several times as long as the second. Rehearsing in
the lead, before the inputs are there, makes the body of the application the second one. Where it
takes longer than the lead (a slow processor) it would make every cycle late, and is left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np

from catenary.plan.wish import Views

ROUNDS = 2  # the first fetches, the second trains the branches
TRIALS = 5

Rehearsal = Callable[[], None]


def fitting_rehearsal(views: Views, lead_ns: int) -> Rehearsal | None:
    """None where it does not fit into the lead."""
    rehearsal = make_rehearsal(views)
    return rehearsal if fastest(rehearsal) <= lead_ns else None


def fastest(call: Callable[[], object], clock: Callable[[], int] = time.perf_counter_ns) -> int:
    """[ns] of a few calls: what is longer was disturbed."""

    def took() -> int:
        before = clock()
        call()
        return clock() - before

    return min(took() for _ in range(TRIALS))


def make_rehearsal(views: Views) -> Rehearsal:
    """Does what bodies do (read the actual values, scale, add, write a vector) without effect."""
    position, velocity = views.actual_position, views.actual_velocity
    targets = (views.target_position, views.target_velocity, views.target_torque)
    scratch, other = np.zeros_like(position), np.zeros_like(position)

    def rehearse() -> None:
        for number in range(ROUNDS):
            reference = 0.1 * math.sin(0.1 * number)
            other[:] = position + reference
            for target in targets:
                scratch[:] = 0.5 * (other - target) - 0.1 * velocity

    return rehearse
