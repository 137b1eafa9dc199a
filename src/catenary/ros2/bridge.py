"""`catenary ros2`: a running loop as a node of a ROS 2 graph.

The bridge attaches to a share like any other client: it reads cycles, sends commands under a lease,
and asks the program of the loop for its devices. It has one thread for all of this. A second one
waits for the answers of the program, which may take seconds.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Any, Self

from msgspec import Struct

from catenary.errors import CatenaryError, ConfigurationError
from catenary.ros2 import messages
from catenary.ros2.backend import COMMAND, GLOVE, Backend, NotAvailable
from catenary.ros2.commands import REFUSED, Commands, State
from catenary.ros2.config import Config, Forward, Point, Trajectory
from catenary.ros2.diagnostics import Reports
from catenary.ros2.followers import GoalRequest, TrajectoryCommand, make_followers
from catenary.ros2.forward import CommandError
from catenary.ros2.goal import Goal
from catenary.ros2.law_parameters import NodeLawParameters
from catenary.ros2.publishing import Publishing
from catenary.ros2.requests import Requests
from catenary.ros2.services import Services
from catenary.ros2.source import Source, stamp_ns
from catenary.ros2.trajectory_action import TrajectoryAction
from catenary.share import attach

IDLE = 0.05  # [s] longest wait
PREPARE_INTERVAL = 5.0  # [s] between two requests for limits that are not known
SHOW_INTERVAL = 1.0  # [s] between the texts for the user


class Bridge:
    """Owner of the attachment to a share, and of a node's topics and services.

        with Bridge("arm", open_backend("arm"), config) as bridge:
            bridge.run()

    Args:
        name: name of the share.
        backend: connection to the ROS 2 graph. The bridge closes it.
        config: configuration.
        uid: owner of the share (`cat.attach`).

    Raises:
        ShareError: The share cannot be opened. Later, the bridge waits for it.
        ConfigurationError: The configuration does not match the share.
    """

    def __init__(
        self, name: str, backend: Backend, config: Config, *, uid: int | None = None
    ) -> None:
        attach(name, uid=uid).close()  # reports a wrong name
        self._backend = backend
        self._config = config
        self.reports = Reports()
        self._source = Source(name, uid)
        self._row = self._source.row()
        self._requests = Requests(name, uid, config.services.timeout)
        self._publishing = Publishing(config, backend, self._source, self._requests, self.reports)
        self._commands: Commands | None = None
        self._run = self._problem = ""  # reason why commands are not possible
        self._prepare_at = 0.0
        self._send_at = self._show_at = 0.0
        self._mismatches = 0  # number of shown QoS mismatches
        self._shown = ""  # last shown report
        self._trajectory: TrajectoryCommand | None = None
        self._action: TrajectoryAction | None = None
        self._parameters: NodeLawParameters | None = None
        self._follow_run()
        self._subscribe()
        self._offer_services()
        self._offer_action()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def run(
        self, stop: threading.Event | None = None, show: Callable[[str], None] | None = None
    ) -> None:
        """Publish and accept commands until `stop` is set. A loop that has ended is awaited.

        Args:
            stop: ends the bridge.
            show: receives missing functions and each report, such as a refused command, as text.
        """
        stop = stop or threading.Event()
        if show is not None:
            for note in self.reports.notes:
                show(note)
        while not stop.is_set():
            self._backend.spin_once(self._time_left())
            self.step()
            if show is not None and time.monotonic() >= self._show_at:
                self._show(show)

    def _show(self, show: Callable[[str], None]) -> None:
        """Show the new reports. A flood of refused commands must not become a flood of texts."""
        self._show_at = time.monotonic() + SHOW_INTERVAL
        mismatches = self._backend.incompatible
        new, self._mismatches = mismatches[self._mismatches :], len(mismatches)
        for text in dict.fromkeys([*new, *self.reports.unread()]):
            if text != self._shown:
                show(text)
                self._shown = text

    def step(self) -> None:
        """Read the share, send the set-points and publish what is due."""
        row = self._source.row()
        reader = self._source.reader
        if self._source.run != self._run:
            self._follow_run()
        if reader is None:
            self._row = None
        elif row is not None:
            self._row = row
        self._command()
        if self._action is not None:
            self._action.step(self._trajectory)
        self._publishing.step(self._row)
        if self._parameters is not None:
            self._parameters.step()

    def close(self) -> None:
        """Release the lease, so that the axes hold, and leave the graph."""
        if self._commands is not None:
            self._commands.stop()
        if self._action is not None:
            self._action.close()
        if self._parameters is not None:
            self._parameters.close()
        self._publishing.close()
        self._requests.close()
        self._source.close()
        self._backend.close()

    def _command(self) -> None:
        now = time.monotonic()
        if self._commands is None or now < self._send_at:
            return
        self._send_at = now + 1.0 / self._config.commands.rate
        reader, row = self._source.reader, self._row
        ros_time = stamp_ns(reader, row) * 1e-9 if reader is not None and row is not None else 0.0
        self._commands.step(reader, row, ros_time)

    def _start_goal(self, request: GoalRequest) -> Goal:
        """Start a goal of the action, or report and raise the CatenaryError of its refusal."""
        try:
            return self._started(request)
        except CatenaryError as error:
            self.reports.add(REFUSED, f"action: {error.message}")
            raise

    def _started(self, request: GoalRequest) -> Goal:
        commands, reader, row = self._commands, self._source.reader, self._row
        if commands is None or reader is None or row is None:
            raise CommandError(self._problem or "there is no running loop with these axes")
        state = State(reader, row, commands.axes)
        goal = commands.start("trajectory", request, reader, state, stamp_ns(reader, row) * 1e-9)
        assert goal is not None  # trajectories have one
        return goal

    def _cancel_goal(self) -> None:
        if self._trajectory is not None:
            self._trajectory.decelerate()

    def _follow_run(self) -> None:
        """Prepare the commands for another run of the loop. Its axes may differ."""
        if self._commands is not None:
            self._commands.stop("the loop has ended")
        self._commands = self._trajectory = None
        self._run = self._source.run
        self._problem = "there is no running loop with axes"
        self._prepare()

    def _prepare(self) -> None:
        """Prepare the commands, if there are axes and the program reports their limits."""
        self._prepare_at = time.monotonic() + PREPARE_INTERVAL
        reader = self._source.reader
        if reader is None or not self._config.commands.on or not reader.layout.axes:
            return
        axes = self._config.commands.axes or reader.layout.axes
        try:
            limits = self._requests.axes()
            followers = make_followers(self._config, axes, limits, self.reports)
        except (CatenaryError, ValueError) as error:
            self._problem = str(getattr(error, "message", error))
            self.reports.add(REFUSED, f"no commands are possible: {self._problem}")
            return
        lease = self._config.commands.lease
        self._commands = Commands(followers, axes, lease, self.reports)
        trajectory = followers["trajectory"]
        self._trajectory = trajectory if isinstance(trajectory, TrajectoryCommand) else None

    def _subscribe(self) -> None:
        """Subscribe to the topics of commands. The queue of each topic has one message."""
        commands = self._config.commands
        if not commands.on:
            return
        offers: list[tuple[str, Trajectory | Forward | Point, type[Struct]]] = [
            ("trajectory", commands.trajectory, messages.JointTrajectory),
            ("forward", commands.forward, messages.Float64MultiArray),
            ("point", commands.point, messages.JointTrajectoryPoint),
        ]
        for name, topic, kind in offers:
            if topic.on:
                self._backend.subscription(topic.topic, kind, COMMAND, self._offer(name))
        if commands.pose is not None:
            offer = self._offer("pose")
            self._backend.subscription(commands.pose.topic, messages.PoseStamped, COMMAND, offer)
        if commands.joint_states is not None:  # gloves often publish with the QoS of sensors
            offer = self._offer("joint_states")
            glove = commands.joint_states.topic
            self._backend.subscription(glove, messages.JointState, GLOVE, offer)
        for each in self._config.parameters:
            update = partial(self._requests.set_parameters, each, self.reports)
            self._backend.subscription(each.topic, messages.Float64MultiArray, COMMAND, update)

    def _offer(self, name: str) -> Callable[[Any], None]:
        def offer(message: Any) -> None:
            if self._commands is None and time.monotonic() >= self._prepare_at:
                self._prepare()
            if self._commands is None:
                self.reports.add(REFUSED, f"{name}: {self._problem}")
            else:
                self._commands.offer(name, message)

        return offer

    def _offer_action(self) -> None:
        name = self._config.commands.trajectory.action
        if not (self._config.commands.on and self._config.commands.trajectory.on and name):
            return
        try:
            self._action = TrajectoryAction(
                self._backend, name, self._start_goal, self._cancel_goal
            )
        except (NotAvailable, ConfigurationError) as error:
            self.reports.notes.append(error.message)

    def _offer_services(self) -> None:
        if not self._config.services.on:
            return
        services = Services(self._source, self._requests, self._stop, self._command_axes)
        try:
            for name, call in services.calls.items():
                self._backend.service(name, "trigger", call)
            if self._config.services.parameters:
                self._parameters = self._law_parameters()
        except NotAvailable:
            text = "services and parameters need rclpy; this backend has topics only"
            self.reports.notes.append(text)

    def _law_parameters(self) -> NodeLawParameters:
        source = self._source
        requests = Requests(source.name, source.uid, self._config.services.timeout)
        return NodeLawParameters(self._backend, requests)

    def _stop(self, reason: str) -> None:
        if self._commands is not None:
            self._commands.stop(reason)

    def _command_axes(self) -> tuple[str, ...]:
        return self._commands.axes if self._commands is not None else ()

    def _time_left(self) -> float:
        """Return the time until something is due [s], at most IDLE."""
        due = self._publishing.next_time
        if self._commands is not None and self._commands.active:
            due = min(due, self._send_at)
        return min(max(due - time.monotonic(), 0.0), IDLE)
