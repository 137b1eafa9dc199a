"""Commands of a ROS 2 graph for the axes of a loop, under a lease.

Rules: only the newest command counts. A command that cannot be executed is refused with a reason.
It moves nothing, and the current motion continues (as in ros2_control). The axes hold after the end
of a motion, after a time-out, and when one of them is disabled; torques become 0. After the loss
of the lease, the bridge sends nothing until the next command.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from catenary.errors import CatenaryError
from catenary.ros2.config import Quantity
from catenary.ros2.diagnostics import Reports
from catenary.ros2.forward import CommandError
from catenary.ros2.goal import Goal
from catenary.share import Lease, Reader
from catenary.wire.cia402 import Mode

Values = npt.NDArray[np.float64]
SetPoints = Mapping[Quantity, Values]
MODES: Mapping[Quantity, tuple[Mode, ...]] = {
    "position": (Mode.CSP, Mode.PP),
    "velocity": (Mode.CSV, Mode.PV),
    "torque": (Mode.CST,),
}
REFUSED, HELD, LOST = "refused commands", "motions held", "leases lost"


class State:
    """State of the commanded axes in one cycle.

    Args:
        reader: reader of the share.
        row: the cycle.
        axes: names of the commanded axes.
    """

    def __init__(self, reader: Reader, row: np.void, axes: Sequence[str]) -> None:
        places = [reader.layout.axes.index(name) for name in axes]
        self.axes = tuple(axes)
        self.position: Values = row["position"][places].astype(np.float64)
        self.velocity: Values = row["velocity"][places].astype(np.float64)
        self.commanded: Values = row["commanded_position"][places].astype(np.float64)
        self._enabled = row["enabled"][places]
        self._modes = row["mode"][places]

    def check(self, quantity: Quantity) -> None:
        """Raise CommandError if an axis is disabled, or if its mode needs another quantity."""
        for name, enabled, mode in zip(self.axes, self._enabled, self._modes, strict=True):
            if not enabled:
                raise CommandError(f"axis {name!r} is not enabled")
            if mode not in MODES[quantity]:
                known = ", ".join(each.name for each in MODES[quantity])
                raise CommandError(
                    f"axis {name!r} is in mode {mode}; {quantity} commands need {known}"
                )


class Follower(Protocol):
    """Execution of the commands of one topic."""

    quantity: Quantity

    def accept(self, message: Any, now: float, state: State) -> Goal | None:
        """Start to execute a message. Return the goal of a trajectory.

        Args:
            message: the message of the topic.
            now: time of the cycle as in the stamps of messages [s].
            state: state of the axes.

        Raises:
            CommandError: The message is refused.
        """

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the set-points; None if the motion has ended.

        Args:
            now: time of the cycle as in the stamps of messages [s].
            state: state of the axes.

        Raises:
            CommandError: The motion must end.
        """

    def cancel(self) -> None:
        """Forget the motion. The next message starts from rest."""


class Commands:
    """Owner of the lease and of the running motion.

    Args:
        followers: followers by name of the topic.
        axes: names of the commanded axes.
        duration: duration of the lease [s].
        reports: receives refused commands and ended motions.
    """

    def __init__(
        self,
        followers: Mapping[str, Follower],
        axes: Sequence[str],
        duration: float,
        reports: Reports,
    ) -> None:
        self.axes = tuple(axes)
        self._followers = followers
        self._duration = duration
        self._reports = reports
        self._pending: tuple[str, Any] | None = None
        self._active: Follower | None = None
        self._lease: Lease | None = None

    @property
    def active(self) -> bool:
        """True while a motion runs."""
        return self._active is not None

    def offer(self, topic: str, message: Any) -> None:
        """Keep a message for the next `step`. It replaces an earlier one of any topic.

        Args:
            topic: name of a follower.
            message: the message.
        """
        self._pending = topic, message

    def step(self, reader: Reader | None, row: np.void | None, now: float) -> None:
        """Accept the newest message, and send the next set-points.

        Args:
            reader: reader of the share; None without a loop.
            row: newest cycle; None without a loop.
            now: time of the cycle as in the stamps of messages [s].
        """
        if reader is None or row is None:
            self._without_loop()
            return
        state = State(reader, row, self.axes)
        if self._pending is not None:
            self._accept(reader, state, now)
        if self._active is not None:
            self._send(self._active, state, now)

    def start(
        self, topic: str, message: Any, reader: Reader, state: State, now: float
    ) -> Goal | None:
        """Start to execute a message at once. Return the goal of a trajectory.

        Args:
            topic: name of a follower.
            message: the message.
            reader: reader of the share.
            state: state of the axes.
            now: time of the cycle as in the stamps of messages [s].

        Raises:
            CatenaryError: The message is refused. The current motion continues.
        """
        self._pending = None  # it is older
        follower = self._followers[topic]
        try:
            state.check(follower.quantity)
            goal = follower.accept(message, now, state)
            if self._lease is None:
                self._lease = reader.lease(self.axes, for_=self._duration)
        except CatenaryError:
            if self._active is not follower:
                follower.cancel()  # its next motion starts from the commanded positions of then
            raise
        if self._active is not follower and self._active is not None:
            self._active.cancel()
        self._active = follower
        return goal

    def stop(self, reason: str = "") -> None:
        """End the motion and release the lease: the axes hold.

        Args:
            reason: reason to report; "" reports nothing.
        """
        self._pending = None
        if reason and self._active is not None:
            self._reports.add(HELD, reason)
        self._drop()

    def _without_loop(self) -> None:
        if self._pending is not None:
            topic, _ = self._pending
            self._reports.add(REFUSED, f"{topic}: there is no running loop")
        self.stop("the loop has ended")

    def _accept(self, reader: Reader, state: State, now: float) -> None:
        assert self._pending is not None
        topic, message = self._pending
        try:
            self.start(topic, message, reader, state, now)
        except CatenaryError as error:
            self._reports.add(REFUSED, f"{topic}: {error.message}")

    def _send(self, follower: Follower, state: State, now: float) -> None:
        try:
            state.check(follower.quantity)
            found = follower.sample(now, state)
        except CatenaryError as error:
            self.stop(error.message)
            return
        if found is None:
            self._drop()
            return
        assert self._lease is not None  # taken with the first message
        try:
            self._lease.send(
                found.get("position"),
                velocity=found.get("velocity"),
                torque=found.get("torque"),
                extrapolate="position" in found and "velocity" in found,
            )
        except CatenaryError as error:
            self._reports.add(LOST, error.message)
            self._lease = None  # it has ended, so a release is not possible
            self._drop()

    def _drop(self) -> None:
        """Forget the motion and release the lease."""
        if self._active is not None:
            self._active.cancel()
            self._active = None
        lease, self._lease = self._lease, None
        if lease is None:
            return
        try:
            lease.release()
        except CatenaryError as error:
            self._reports.add(LOST, error.message)
