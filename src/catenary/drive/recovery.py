"""Recovery: stop drives while a stop condition holds, and enable them again afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from catenary.drive.drives import Drives
from catenary.errors import DriveError
from catenary.plan.stop_reason import StopReason

RESET_PERIOD = 0.1  # [s] between two changes of the reset bit, whose rising edge resets a fault


class Phase(IntEnum):
    """Phase of the drives between one stop and the next."""

    STARTING = 0  # not all drives are enabled yet
    RUNNING = 1  # all drives are enabled
    STOPPED = 2  # the drives are stopped, and must not move yet


class CycleNow(Protocol):
    """Number and time of a cycle."""

    @property
    def number(self) -> int:
        """Number of the cycle."""

    @property
    def time(self) -> float:
        """Time of the cycle [s]."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Reason for a stop, and the number and time [s] of the cycle that requested it."""

    number: int
    time: float
    reason: str


class Recovery:
    """Owner of the recovery of some drives from a stop. Call `step` once in every cycle.

        recovery = cat.drive.Recovery(arm)
        with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
            for cycle in loop:
                if recovery.step(cycle, why_stop(arm)) == cat.drive.Phase.RUNNING:
                    arm.target.position[:] = ...

    With a reason, the frame of this cycle requests a quick stop of all drives. Faults are reset
    while the reason holds. When there has been no reason for some time, all drives are enabled
    again. `stops` lists all stops so far. `just_stopped` is True if the last step was a stop.

    The stop of an operator (`catenary.share.Reader.stop`) is a reason, too. The drives are not
    enabled again afterwards: the operator or the program must enable all of them.

    Args:
        drives: the drives.
        after: time without a reason, after which the drives are enabled [s].
        patience: longest time until all drives are enabled [s].

    Raises:
        ValueError: `after` is negative, or `patience` is not positive.
    """

    def __init__(self, drives: Drives, *, after: float = 1.0, patience: float = 5.0) -> None:
        if after < 0 or patience <= 0:
            raise ValueError(
                f"after={after} s must not be negative, patience={patience} s must be positive"
            )
        self.phase = Phase.STARTING
        self.stops: list[Stop] = []
        self.just_stopped = False
        self._drives = drives
        self._after = after
        self._patience = patience
        self._since: float | None = None  # [s] time of the last reason or enable request
        self._next_reset = 0.0
        self._resetting = False
        self._by_operator = False  # an operator has stopped a drive, and all are not enabled yet

    def step(self, cycle: CycleNow, reason: str | None = None, *, ready: bool = True) -> Phase:
        """Stop or recover the drives.

        Args:
            cycle: present cycle of the loop.
            reason: reason why the drives must not move; None if they may move.
            ready: False to stay in STARTING although the drives are enabled.

        Returns:
            New phase.

        Raises:
            DriveError: The drives are not enabled and ready within `patience`.
        """
        now, self.just_stopped = cycle.time, False
        since = self._since = now if self._since is None else self._since
        if StopReason.OPERATOR in self._drives.stopped:  # until the next request of the program
            self._by_operator = True
            if self.phase != Phase.STOPPED:
                reason = reason or StopReason.OPERATOR.text
        if reason and self.phase != Phase.STOPPED:
            self._stop(cycle, reason)
        elif reason:
            self._since = now
            self._remain_stopped(now)
        elif self.phase == Phase.STOPPED:
            self._end_stop(now, now > since + self._after)
        elif self.phase == Phase.STARTING:
            self._start(now - since, ready)
        return self.phase

    def _end_stop(self, now: float, is_over: bool) -> None:
        """Enable the drives, or wait until they are enabled after the stop of an operator."""
        if self._by_operator:
            is_over = bool((self._drives.enabled | self._drives.jogged).all())
        elif is_over:
            self._drives.enable()
        if is_over:
            self._by_operator = False
            self.phase, self._since = Phase.STARTING, now

    def _remain_stopped(self, now: float) -> None:
        """Reset faults. Stop drives that an operator has enabled."""
        if (self._drives.enabled | self._drives.jogged).any():
            self._drives.quick_stop()
        else:
            self._reset(now)

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
        enabled = self._drives.enabled | self._drives.jogged
        if ready and enabled.all():
            self.phase = Phase.RUNNING
        elif waited > self._patience:
            names = zip(self._drives.names, enabled, strict=True)
            missing = [name for name, is_enabled in names if not is_enabled]
            if missing:
                what = f"not enabled within {self._patience:g} s: {', '.join(missing)}"
            else:
                what = f"all drives are enabled, but not ready within {self._patience:g} s"
            raise DriveError(
                what, hint="check Drives.state, safe torque off, the main supply and faults"
            )
