"""Options of a plan, with their defaults."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from catenary.plan.clocks import BURST
from catenary.plan.cycle import ExecutionMode, FollowedClock, ReceiveMode

PERIOD_MIN, PERIOD_MAX = 1e-6, 1000.0  # [s]; the limits of the core are wider
LATE_LIMIT_POSITION = 0.050  # [s], CSP
LATE_LIMIT_VELOCITY = 0.050  # [s], CSV
LATE_LIMIT_TORQUE = 0.010  # [s], CST
HANDOVER = 0.020  # [s], CST
COMMAND_TIMEOUT_VELOCITY = 0.200  # [s], CSV
COMMAND_TIMEOUT_TORQUE = 0.020  # [s], CST


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanOptions:
    """Options of a plan that do not belong to a single request.

    Args:
        period: Period of the cycle [s].
        execution: "threaded" or "inline".
        receive_mode: "poll", "wait" or "busy".
        optional: Positions of devices whose loss does not make a cycle bad, in addition to the
            devices of optional requests. A device without a request is required if any requested
            device is, or if there are no requests.
        watchdog: Watchdog time of process data [s]; 0: off. None: 0.1 s, or the longer of 10 ms and
            five exchanges for devices in CST.
        collect_share: If threaded, share of the period, from the wake-up on, in which frames may
            return.
        lost_limit: Number of consecutive bad cycles before WorkingCounterError.
        late_limit_position: Longest time without fresh set-points in CSP [s]; 0: unlimited.
        late_limit_velocity: The same in CSV [s].
        late_limit_torque: The same in CST [s]; 0 is refused.
        handover: Time for which CST keeps its torque after a law or stream ended [s].
        command_timeout_velocity: Time for which an update of a background loop is valid in CSV [s].
        command_timeout_torque: Time for which an update of a background loop is valid in CST [s].
        stop_deadline: Longest time from quick stop to standstill [s].
        busy_wait: Time of a busy-wait before each cycle start [s].
        log: Number of cycles in the log.
        log_axes: True to also log the values of the axes.
        cpu: CPU of the native thread; None: unchanged.
        priority: SCHED_FIFO priority of the native thread; None: unchanged.
        clock: Clock that the others follow: "reference", or "main" for the link's clock.
        reference: Position of the reference clock; None: the first device with a clock.
        margin: Time between the cycle start and the frames [s]; None: a share of the period that
            depends on the execution mode.
        burst: Number of frames that synchronise the clocks before the cycle begins.
        exact_matching: True if every frame carries the cycle number (plan/frames.py).
    """

    period: float = 1e-3
    execution: ExecutionMode = "threaded"
    receive_mode: ReceiveMode = "wait"
    optional: Collection[int] = ()
    watchdog: float | None = None
    collect_share: float = 0.8
    lost_limit: int = 3
    late_limit_position: float = LATE_LIMIT_POSITION
    late_limit_velocity: float = LATE_LIMIT_VELOCITY
    late_limit_torque: float = LATE_LIMIT_TORQUE
    handover: float = HANDOVER
    command_timeout_velocity: float = COMMAND_TIMEOUT_VELOCITY
    command_timeout_torque: float = COMMAND_TIMEOUT_TORQUE
    stop_deadline: float = 2.0
    busy_wait: float = 0.0
    log: int = 1000
    log_axes: bool = False
    cpu: int | None = None
    priority: int | None = 80
    clock: FollowedClock = "reference"
    reference: int | None = None
    margin: float | None = None
    burst: int = BURST
    exact_matching: bool = False

    @property
    def period_ns(self) -> int:
        """Period [ns]. Raises ValueError unless it is between 1 us and 1000 s."""
        return period_in_ns(self.period)

    @property
    def collect_deadline_ns(self) -> int:
        """Time from the wake-up until the frames must be back, if threaded [ns]."""
        return round(self.period_ns * self.collect_share)


def period_in_ns(period: float) -> int:
    """Return a period [ns]. Raise ValueError unless it is between 1 us and 1000 s."""
    if not PERIOD_MIN <= period <= PERIOD_MAX:
        raise ValueError(f"period={period} s: must be {PERIOD_MIN:g} to {PERIOD_MAX:g} s")
    return round(period * 1e9)
