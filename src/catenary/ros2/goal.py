"""Goals of a trajectory follower, and their results."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from catenary.ros2.limits import Tolerances
from catenary.ros2.spline import Row, Spline
from catenary.ros2.waypoints import Code


class AxisStates(NamedTuple):
    """State of the axes: measured [rad, rad/s] and commanded [rad] values, each (n,)."""

    position: Row
    velocity: Row
    commanded_position: Row


class Status(Enum):
    """Status of a goal."""

    WAITING = "waiting"  # its start time is in the future
    ACTIVE = "active"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"
    PREEMPTED = "preempted"  # a newer trajectory has replaced it


class Result(NamedTuple):
    """Result of a goal: code of FollowJointTrajectory, and the reason as text."""

    status: Status
    code: Code
    text: str


@dataclass(eq=False, slots=True)
class Goal:
    """Accepted trajectory. Owns its result."""

    number: int
    status: Status = Status.ACTIVE
    result: Result | None = None

    @property
    def finished(self) -> bool:
        """True if the goal has a result."""
        return self.result is not None

    def finish(self, status: Status, code: Code, text: str) -> Result:
        """Set and return the result.

        Args:
            status: final status.
            code: result code.
            text: reason.
        """
        self.status, self.result = status, Result(status, code, text)
        return self.result


@dataclass(frozen=True, slots=True)
class Plan:
    """Spline of a goal. Its times count from `origin` [s]."""

    path: Spline
    origin: float
    goal: Goal
    tolerances: Tolerances

    @property
    def end(self) -> float:
        """Time of the last waypoint [s]."""
        return self.origin + self.path.end
