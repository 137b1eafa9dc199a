"""Homing of a gripper against its hard stops, the commanded torque as the indicator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, table

KIND = 12.0
NUMBERS = 5  # opening velocity, torque, time, clearance, travel
STATES = 6  # stage, time pressed [s], where the stage began [rad]; open, closed stop, meeting
FRESH, OPENING, OPENED, CLOSING, RETURNING, RETURNED, MEETING, DONE = map(float, range(8))
FAILED = -1.0


@dataclass(frozen=True, slots=True)
class Stops:
    """Results of homing: (n,) [rad] of each axis, NaN before its result is known.

    `failed`: (n,) True for an axis that reached no stop in its travel, or met one on its return.
    """

    open: Row
    closed: Row
    meeting: Row
    failed: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Homing:
    """Three phases, as published for RDDA: all axes open until each has hit its stop; one after the
    other they close to their stop and return; all close until they meet.

    `velocity` [rad/s] of opening (its sign is the way to open). A stop is a commanded torque of at
    least `torque` [N·m] in the way of motion for `time` [s]. An axis has returned when it is within
    `clearance` [rad] of its open stop. One that has gone `travel` [rad] without a stop, or is
    stopped on its return, has failed, and all stand. Give the loop that follows a torque limit
    above `torque`: else no stop is ever found.
    """

    axes: int
    velocity: PerAxis
    torque: PerAxis
    travel: PerAxis
    time: PerAxis = 0.02
    clearance: PerAxis = 0.02

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 5 · axes,)."""
        n = axis_count(self.axes)
        velocity = checked("velocity", self.velocity, n, least=-np.inf, above=True)
        for i in np.flatnonzero(velocity == 0).tolist():
            raise ValueError(f"velocity of axis {i}: 0, it would never arrive")
        names = ("torque", "time", "clearance", "travel")
        others = [checked(name, getattr(self, name), n, above=name != "time") for name in names]
        return table(KIND, velocity, *others)

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (6 · axes,)."""
        return np.zeros(STATES * self.axes)


@compiles
def homing(
    memory: Row, parameters: Row, i: int, position: float, torque: float, dt: float
) -> float:
    """One step of axis `i`: its velocity set-point [rad/s]. `torque` [N·m]: the one commanded
    last, by the velocity loop that follows this set-point."""
    if parameters[0] != KIND:
        raise ValueError("homing: these are not the parameters of a Homing")
    n = len(memory) // STATES
    m, p = STATES * i, 1 + NUMBERS * i
    if lowest(memory, 0, n) == FAILED:
        return 0.0
    stage = following(memory, parameters, i, n, position, torque, dt)
    if stage != memory[m]:
        memory[m + 1] = memory[m] if stage == FAILED else 0.0  # where it failed
        memory[m + 2] = position
        memory[m] = stage
    velocity: float = parameters[p] * way_of(stage)
    return velocity


@compiles
def homed(memory: Row) -> bool:
    """Return True if homing has ended: all axes have met, or one has failed."""
    least = lowest(memory, 0, len(memory) // STATES)
    return bool(least in (DONE, FAILED))


def stops(memory: Row) -> Stops:
    """Return the results so far, from the memory of a `Homing`."""
    rows = memory.reshape(-1, STATES)
    passed = [OPENING, CLOSING, MEETING]
    reached = np.where(rows[:, :1] == FAILED, rows[:, 1:2], rows[:, :1]) > passed
    found = np.where(reached, rows[:, 3:], np.nan)
    return Stops(found[:, 0], found[:, 1], found[:, 2], rows[:, 0] == FAILED)


@compiles
def following(
    memory: Row, parameters: Row, i: int, n: int, position: float, torque: float, dt: float
) -> float:
    """Return the current stage of axis `i`."""
    m, p = STATES * i, 1 + NUMBERS * i
    stage: float = memory[m]
    way = way_of(stage)
    if stage == FRESH:
        return OPENING
    if way != 0.0 and abs(position - memory[m + 2]) > parameters[p + 4]:
        return FAILED
    if stage == RETURNING:
        near = abs(position - memory[m + 3]) <= parameters[p + 3]
        if near:
            return RETURNED
        blocked = pressed(memory, m, parameters, p, parameters[p] * torque, dt)
        return FAILED if blocked else RETURNING
    if way != 0.0 and pressed(memory, m, parameters, p, way * parameters[p] * torque, dt):
        memory[m + 3 + int(stage == CLOSING) + 2 * int(stage == MEETING)] = position
        return stage + 1.0
    if stage == OPENED and lowest(memory, 0, n) >= OPENED and lowest(memory, 0, i) >= RETURNED:
        return CLOSING
    if stage == RETURNED and lowest(memory, 0, n) >= RETURNED:
        return MEETING
    return stage


@compiles
def way_of(stage: float) -> float:
    """Return the direction of a stage: 1 opening, -1 closing, 0 standing."""
    if stage in (OPENING, RETURNING):
        return 1.0
    return -1.0 if stage in (CLOSING, MEETING) else 0.0


@compiles
def pressed(memory: Row, m: int, parameters: Row, p: int, forward: float, dt: float) -> bool:
    """Return True if a torque in the direction of motion (`forward`) has lasted long enough."""
    if forward < parameters[p + 1] * abs(parameters[p]):
        memory[m + 1] = 0.0
        return False
    memory[m + 1] += dt
    return bool(memory[m + 1] >= parameters[p + 2])


@compiles
def lowest(memory: Row, first: int, last: int) -> float:
    """Return the lowest stage of some axes; `DONE` for no axes."""
    found = DONE
    for i in range(first, last):
        found = min(found, memory[STATES * i])
    return found
