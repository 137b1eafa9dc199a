"""Homing of a gripper against its hard stops, which are detected by the commanded torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

KIND = 12.0
NUMBERS = 5  # opening velocity, torque, time, clearance, travel
# stage, time at the torque [s], start position of the stage [rad]; positions [rad] of the open
# stop, of the closed stop, and where the axes meet
STATES = 6
FRESH, OPENING, OPENED, CLOSING, RETURNING, RETURNED, MEETING, DONE = map(float, range(8))
FAILED = -1.0


@dataclass(frozen=True, slots=True)
class Stops:
    """Results of homing for each axis, each with shape (n,).

    `open` and `closed` are the positions of the stops [rad]. `meeting` is the position where the
    axes meet [rad]. An unknown result is NaN. `failed` is True for an axis that found no stop
    within its travel, or was blocked on its return.
    """

    open: Row
    closed: Row
    meeting: Row
    failed: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Homing:
    """Settings of homing in three phases, as published for the gripper RDDA.

    1. All axes open until each is at its open stop.
    2. One axis after the other closes to its closed stop and returns.
    3. All axes close until they meet.

    Homing fails if an axis finds no stop within its travel, or is blocked on its return. All axes
    then stop. The torque limit of the velocity loop must be above `torque`; otherwise no stop is
    ever detected.

    Args:
        axes: number of axes.
        velocity: opening velocity [rad/s]. Its sign is the opening direction.
        torque: torque in the direction of motion that indicates a stop [N·m].
        travel: longest travel without a stop [rad].
        time: time for which the torque must last [s].
        clearance: distance from the open stop at which an axis has returned [rad].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.
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
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 5 · axes,)."""
        n = axis_count(self.axes)
        velocity = checked("velocity", self.velocity, n, least=-np.inf, above=True)
        for i in np.flatnonzero(velocity == 0).tolist():
            raise ValueError(f"velocity of axis {i} is 0; it must not be 0")
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
    """Compute one step of axis `i`.

    Args:
        memory: `Homing.memory`.
        parameters: `Homing.parameters`.
        i: number of the axis.
        position: measured position [rad].
        torque: torque that the velocity loop commanded in the previous step [N·m].
        dt: time since the previous step [s].

    Returns:
        Velocity set-point [rad/s]; 0 while the axis waits for the others, and when homing has
        ended.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("homing: not the parameters of a Homing")
    n = len(memory) // STATES
    m, p = STATES * i, 1 + NUMBERS * i
    if lowest(memory, 0, n) == FAILED:
        return 0.0
    stage = next_stage(memory, parameters, i, n, position, torque, dt)
    if stage != memory[m]:
        memory[m + 1] = memory[m] if stage == FAILED else 0.0  # keep the stage that failed
        memory[m + 2] = position
        memory[m] = stage
    velocity: float = parameters[p] * direction_of(stage)
    return velocity


@compiles
def homed(memory: Row) -> bool:
    """Return True if homing has ended: all axes have met, or an axis has failed."""
    least = lowest(memory, 0, len(memory) // STATES)
    return bool(least in (DONE, FAILED))


def stops(memory: Row) -> Stops:
    """Return the results of a homing so far, from its memory."""
    rows = memory.reshape(-1, STATES)
    passed = [OPENING, CLOSING, MEETING]
    reached = np.where(rows[:, :1] == FAILED, rows[:, 1:2], rows[:, :1]) > passed
    found = np.where(reached, rows[:, 3:], np.nan)
    return Stops(found[:, 0], found[:, 1], found[:, 2], rows[:, 0] == FAILED)


@compiles
def next_stage(
    memory: Row, parameters: Row, i: int, n: int, position: float, torque: float, dt: float
) -> float:
    """Return the stage of axis `i` after this step.

    The step counts the time at the torque, and stores the position of a stop that it finds.
    """
    m, p = STATES * i, 1 + NUMBERS * i
    stage: float = memory[m]
    direction = direction_of(stage)
    if stage == FRESH:
        return OPENING
    if direction != 0.0 and abs(position - memory[m + 2]) > parameters[p + 4]:
        return FAILED
    if stage == RETURNING:
        near = abs(position - memory[m + 3]) <= parameters[p + 3]
        if near:
            return RETURNED
        blocked = pressed(memory, m, parameters, p, parameters[p] * torque, dt)
        return FAILED if blocked else RETURNING
    forward = direction * parameters[p] * torque
    if direction != 0.0 and pressed(memory, m, parameters, p, forward, dt):
        memory[m + 3 + int(stage == CLOSING) + 2 * int(stage == MEETING)] = position
        return stage + 1.0
    if stage == OPENED and lowest(memory, 0, n) >= OPENED and lowest(memory, 0, i) >= RETURNED:
        return CLOSING
    if stage == RETURNED and lowest(memory, 0, n) >= RETURNED:
        return MEETING
    return stage


@compiles
def direction_of(stage: float) -> float:
    """Return the direction of motion in a stage: 1 opening, -1 closing, 0 at rest."""
    if stage in (OPENING, RETURNING):
        return 1.0
    return -1.0 if stage in (CLOSING, MEETING) else 0.0


@compiles
def pressed(memory: Row, m: int, parameters: Row, p: int, forward: float, dt: float) -> bool:
    """Return True if the torque has indicated a stop for the required time.

    The call adds `dt` to this time, or resets the time if the torque is too small.
    `forward` is the torque times the signed opening velocity and the direction of motion.
    """
    if forward < parameters[p + 1] * abs(parameters[p]):
        memory[m + 1] = 0.0
        return False
    memory[m + 1] += dt
    return bool(memory[m + 1] >= parameters[p + 2])


@compiles
def lowest(memory: Row, first: int, last: int) -> float:
    """Return the lowest stage of the axes `first` to `last` - 1; `DONE` for an empty range."""
    found = DONE
    for i in range(first, last):
        found = min(found, memory[STATES * i])
    return found
