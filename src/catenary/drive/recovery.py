"""Recovery: stop drives while a stop condition holds, and enable them again afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from catenary.drive.drives import Drives
from catenary.errors import DriveError

RESET_PERIOD = 0.1  # [s]: a reset is an edge of the controlword, so it is cleared in between


class Phase(IntEnum):
    """Phase of the drives between one stop and the next."""

    STARTING = 0  # not all are enabled yet
    RUNNING = 1
    STOPPED = 2


class CycleNow(Protocol):
    """A cycle of a loop."""

    @property
    def number(self) -> int: ...

    @property
    def time(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Stop:
    """Reason of a stop, and the number and time [s] of the cycle that sent it."""

    number: int
    time: float
    reason: str


class Recovery:
    """Owns the recovery of some drives from a stop: call `step` once in every cycle.

        recovery = cat.drive.Recovery(arm)
        with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
            for cycle in loop:
                if recovery.step(cycle, why_stop(arm)) == cat.drive.Phase.RUNNING:
                    arm.target.position[:] = ...

    With a reason, all drives are stopped quickly in this cycle's frame, and faults are reset while
    the reason holds. After `after` seconds without one, all are enabled again. `DriveError` if this
    takes longer than `patience` [s]. `stops`: all stops so far; `just_stopped`: True if the last
    step was one.
    """

    def __init__(self, drives: Drives, *, after: float = 1.0, patience: float = 5.0) -> None:
        if after < 0 or patience <= 0:
            raise ValueError(f"after={after} s, patience={patience} s: how long must be positive")
        self.phase = Phase.STARTING
        self.stops: list[Stop] = []
        self.just_stopped = False  # in the last step
        self._drives = drives
        self._after = after
        self._patience = patience
        self._since: float | None = None  # [s] time of the last reason or enable request
        self._next_reset = 0.0
        self._resetting = False

    def step(self, cycle: CycleNow, reason: str | None = None, *, ready: bool = True) -> Phase:
        """Stop or recover the drives, and return the new phase.

        Args:
            cycle: The cycle.
            reason: Reason why the drives must not move; None if they may.
            ready: False: keep the drives in STARTING although they are enabled.
        """
        now, self.just_stopped = cycle.time, False
        since = self._since = now if self._since is None else self._since
        if reason and self.phase != Phase.STOPPED:
            self._stop(cycle, reason)
        elif reason:
            self._since = now
            self._reset(now)
        elif self.phase == Phase.STOPPED and now > since + self._after:
            self._drives.enable()
            self.phase, self._since = Phase.STARTING, now
        elif self.phase == Phase.STARTING:
            self._start(now - since, ready)
        return self.phase

    def _stop(self, cycle: CycleNow, reason: str) -> None:
        self._drives.quick_stop()
        self.stops.append(Stop(cycle.number, cycle.time, reason))
        self.phase, self._since, self.just_stopped = Phase.STOPPED, cycle.time, True
        self._next_reset = cycle.time + RESET_PERIOD

    def _reset(self, now: float) -> None:
        if now < self._next_reset or not self._drives.faults:
            return
        self._next_reset = now + RESET_PERIOD
        self._resetting = not self._resetting
        if self._resetting:
            self._drives.reset_faults()
        else:
            self._drives.disable()

    def _start(self, waited: float, ready: bool) -> None:
        if ready and self._drives.enabled.all():
            self.phase = Phase.RUNNING
        elif waited > self._patience:
            names = zip(self._drives.names, self._drives.enabled, strict=True)
            missing = [name for name, enabled in names if not enabled]
            raise DriveError(
                f"not enabled within {self._patience:g} s: {', '.join(missing) or 'all are'}"
                + ("" if missing else ", but what they wait for is not ready"),
                hint="safe torque off, main supply, a fault? See Drives.state",
            )
