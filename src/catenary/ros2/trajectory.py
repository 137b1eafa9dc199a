"""Execution of joint trajectories with the semantics of FollowJointTrajectory, without transport.

The reference is ros2_control's joint_trajectory_controller (control.ros.org): "Trajectory
Representation", "Trajectory Replacement" and "Details about parameters". Differences:

- A trajectory beyond a limit of an axis is refused. There is no check in ros2_control.
- A replacement continues from the planned position and velocity, not from the measured ones.
- A cancelled or aborted motion decelerates along its direction, then holds.
- An empty trajectory stops the axes, as the controller of ROS 1 did.
- A refused trajectory leaves the current one unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.ros2.goal import AxisStates, Goal, Plan, Result, Status
from catenary.ros2.limits import (
    AxisLimits,
    Tolerances,
    check_limits,
    limit_pairs,
    stop_time,
    worst,
)
from catenary.ros2.spline import Motion, Row, Spline, Waypoint, spline
from catenary.ros2.waypoints import (
    Code,
    Request,
    TrajectoryError,
    TrajectoryLike,
    checked,
    for_all_axes,
)

SHORTEST_STOP = 1e-3  # [s]; a shorter stop is a hold


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerOptions:
    """Options of a `TrajectoryFollower`.

    `partial` accepts trajectories that name some of the joints only. A first waypoint at time 0
    must be within `start_tolerance` [rad] of the planned position. A start more than `ahead` [s]
    in the future is refused, because it shows clocks that differ.
    """

    partial: bool = False
    start_tolerance: float = 0.01
    ahead: float = 60.0


class TrajectoryFollower:
    """Owns the motion of some axes: the current trajectory, and one that starts later.

    All times `now` are seconds on the clock of the header stamps. A motion continues from the
    set-points before it. Call `abort` when the axes do not receive these set-points any more: the
    next motion then starts from their commanded positions.

    Args:
        joints: names of the axes.
        limits: limits of the axes.
        tolerances: default tolerances; None for no checks but `stopped_velocity`.
        options: further options.
    """

    def __init__(
        self,
        joints: Sequence[str],
        limits: AxisLimits,
        tolerances: Tolerances | None = None,
        options: FollowerOptions | None = None,
    ) -> None:
        self.joints = tuple(joints)
        self.limits = limits
        self.tolerances = tolerances or Tolerances.of(len(self.joints))
        self.result: Result | None = None  # of the goal that finished last
        self._options = options or FollowerOptions()
        self._plan: Plan | None = None
        self._later: Plan | None = None
        self._held: Row | None = None
        self._now = -math.inf
        self._goals = 0

    @property
    def goal(self) -> Goal | None:
        """Goal that is being executed; None if there is none."""
        return self._plan.goal if self._plan and not self._plan.goal.finished else None

    @property
    def active(self) -> bool:
        """True while a goal is executed or waits, or the axes decelerate."""
        moving = self._plan is not None and self._now < self._plan.end
        return moving or self.goal is not None or self._later is not None

    def accept(
        self,
        trajectory: TrajectoryLike,
        now: float,
        state: AxisStates,
        tolerances: Tolerances | None = None,
    ) -> Goal:
        """Check a trajectory and start it, now or at the time of its stamp.

        Waypoints in the past are discarded. A trajectory without points stops the axes.

        Args:
            trajectory: message `trajectory_msgs/JointTrajectory`.
            now: time [s].
            state: state of the axes.
            tolerances: tolerances of this goal; None for the default.

        Returns:
            Goal, whose result is set when it is finished.

        Raises:
            TrajectoryError: The trajectory is refused. The current one continues.
        """
        self._wake(now, state)
        if not trajectory.points:
            return self._stop_goal()
        request = checked(trajectory, self.joints, self._options.partial)
        start = self._now if request.start is None else request.start
        path = self._path(self._remaining(request, start), start)
        self._goals += 1
        plan = Plan(path, start, Goal(self._goals), tolerances or self.tolerances)
        if self._later:
            self._finish(self._later.goal, Status.PREEMPTED, text="replaced by a newer trajectory")
            self._later = None
        if start > self._now:
            plan.goal.status, self._later = Status.WAITING, plan
        else:
            self._start(plan)
        return plan.goal

    def sample(self, now: float, state: AxisStates) -> tuple[Row, Row]:
        """Return the set-points of the axes, and update the goal.

        Args:
            now: time [s]. An earlier time than that of the last call counts as the latter.
            state: state of the axes.

        Returns:
            Positions [rad] and velocities [rad/s], each (n,).
        """
        self._wake(now, state)
        if self._later and self._now >= self._later.origin:
            plan, self._later = self._later, None
            self._start(plan)
        motion = self._planned(self._now)
        if self._plan and not self._plan.goal.finished:
            self._judge(self._plan, motion, state)
        return motion.position, motion.velocity

    def cancel(self, now: float) -> None:
        """Cancel all goals and decelerate to a hold. `now` is the time [s]."""
        self._now = max(now, self._now)
        self._stop(Status.CANCELED, Code.SUCCESSFUL, "canceled")

    def abort(self, reason: str) -> None:
        """Abort all goals without a stop, because the axes cannot be commanded."""
        for plan in filter(None, (self._plan, self._later)):
            self._finish(plan.goal, Status.ABORTED, Code.INVALID_GOAL, reason)
        self._plan = self._later = self._held = None

    def _wake(self, now: float, state: AxisStates) -> None:
        """Set the time. The first motion starts from where the axes are commanded."""
        self._now = max(now, self._now)
        if self._plan is None and self._held is None:
            commanded = np.array(state.commanded_position, dtype=np.float64)
            if not np.isfinite(commanded).all():
                raise TrajectoryError(
                    Code.INVALID_GOAL, f"the commanded positions are {commanded.tolist()}"
                )
            self._held = commanded

    def _planned(self, time: float) -> Motion:
        if self._plan:
            return self._plan.path.at(time - self._plan.origin)
        assert self._held is not None  # set by _wake
        rest = np.zeros_like(self._held)
        return Motion(self._held, rest, rest)

    def _remaining(self, request: Request, start: float) -> Request:
        """Return the request without its waypoints that need no motion any more."""
        options, first = self._options, request.points[0]
        if start > self._now + options.ahead:
            text = f"it starts in {start - self._now:.3f} s; the limit is {options.ahead:g} s"
            raise TrajectoryError(Code.INVALID_GOAL, text)
        if start >= self._now and first.time == 0:
            begin = self._planned(start).position[list(request.axes)]
            error = float(abs(begin - first.position).max())
            if error > options.start_tolerance:
                text = f"the point at time 0 is {error:.6g} rad from the planned position"
                raise TrajectoryError(Code.INVALID_GOAL, text)
        begin_time = max(self._now - start, 0.0)
        points = tuple(point for point in request.points if point.time > begin_time)
        if points:
            return replace(request, points=points)
        if start < self._now:
            late = self._now - start - request.points[-1].time
            text = f"all points are in the past, the last one by {late:.3f} s"
            raise TrajectoryError(Code.OLD_HEADER_TIMESTAMP, text)
        raise TrajectoryError(Code.INVALID_GOAL, "no point is after the start")

    def _path(self, request: Request, start: float) -> Spline:
        """Return the spline from the planned state. Raises TrajectoryError beyond a limit."""
        begin_time = max(self._now, start)
        begin = self._planned(begin_time)
        points = for_all_axes(request, begin_time - start, begin)
        path = spline(begin, points, begin_time - start)
        bounds = limit_pairs(self.limits)
        ranges = [path.extremes(order, *bound) for order, bound in enumerate(bounds)]
        check_limits(self.joints, self.limits, ranges)
        return path

    def _start(self, plan: Plan) -> None:
        if self._plan:
            text = "replaced by a newer trajectory"
            self._finish(self._plan.goal, Status.PREEMPTED, text=text)
        plan.goal.status = Status.ACTIVE
        self._plan = plan

    def _judge(self, plan: Plan, motion: Motion, state: AxisStates) -> None:
        """Finish the goal if a tolerance is violated or the goal is reached."""
        errors = abs(motion.position - state.position)
        if self._now < plan.end:
            if not (errors <= plan.tolerances.path).all():
                text = worst("path", self.joints, errors, plan.tolerances.path)
                self._stop(Status.ABORTED, Code.PATH_TOLERANCE_VIOLATED, text)
            return
        tolerances = plan.tolerances
        stopped = (abs(state.velocity) <= tolerances.stopped_velocity).all()
        if stopped and (errors <= tolerances.goal).all():
            self._finish(plan.goal, Status.SUCCEEDED, text="goal reached")
        elif self._now > plan.end + tolerances.goal_time:
            text = worst("goal", self.joints, errors, tolerances.goal)
            if (errors <= tolerances.goal).all():
                text = f"still moving {tolerances.goal_time:g} s after the end"
            self._stop(Status.ABORTED, Code.GOAL_TOLERANCE_VIOLATED, text)

    def _stop_goal(self) -> Goal:
        self._stop(Status.PREEMPTED, Code.SUCCESSFUL, "stopped by an empty trajectory")
        self._goals += 1
        goal = Goal(self._goals)
        if self._plan:
            self._plan = replace(self._plan, goal=goal)
        else:
            self._finish(goal, Status.SUCCEEDED, text="the axes are at rest")
        return goal

    def _stop(self, status: Status, code: Code, text: str) -> None:
        """Finish all goals, and decelerate from the planned state."""
        for plan in filter(None, (self._plan, self._later)):
            self._finish(plan.goal, status, code, text)
        self._later = None
        begin = self._planned(self._now) if self._plan or self._held is not None else None
        if begin is None:
            return
        duration = stop_time(self.limits, begin.position, begin.velocity)
        if duration < SHORTEST_STOP:
            self._plan, self._held = None, begin.position
            return
        rest = begin.position + begin.velocity * duration / 2
        path = spline(begin, [Waypoint(duration, rest, np.zeros_like(rest))], 0.0)
        goal = Goal(0, status, Result(status, code, text))
        self._plan = Plan(path, self._now, goal, self.tolerances)

    def _finish(
        self, goal: Goal, status: Status, code: Code = Code.SUCCESSFUL, text: str = ""
    ) -> None:
        if not goal.finished:
            self.result = goal.finish(status, code, text)
