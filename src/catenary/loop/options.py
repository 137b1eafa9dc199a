"""Grouped options of a Loop: stop conditions, scheduling and distributed clocks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral
from typing import Literal

from catenary.bus import SubDevice
from catenary.loop.external_clock import ExternalClock, require_name
from catenary.plan.clocks import BURST
from catenary.plan.cycle import FollowedClock, ReceiveMode
from catenary.plan.options import (
    COMMAND_TIMEOUT_TORQUE,
    COMMAND_TIMEOUT_VELOCITY,
    HANDOVER,
    LATE_LIMIT_POSITION,
    LATE_LIMIT_TORQUE,
    LATE_LIMIT_VELOCITY,
)

AxisStopReaction = Literal["raise", "event"]
ReturnPolicy = Literal["restore", "hold"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StopPolicy:
    """Conditions that stop axes or end a loop, and the handling of devices that return.

    Args:
        late_limit: Time without fresh set-points before a quick stop [s]. None: 50 ms in CSP, CSV
            and PV, 10 ms in CST. 0: never; refused for axes that use CST.
        handover: Time for which CST keeps its torque after a law or stream ended, before a quick
            stop [s].
        command_timeout: In the background, time for which the targets of an update are valid [s].
            After it, CSV and PV decelerate and CST makes a quick stop. None: 0.2 s in CSV and PV,
            20 ms in CST. CSP holds without limit.
        stop_deadline: Time for the axes to reach standstill when the loop is left [s].
        lost_limit: Number of consecutive bad cycles that raises WorkingCounterError.
        raise_faults: True: raise DriveError if a drive is in fault or leaves OPERATION_ENABLED by
            itself (STO). False: see `Drives.faults` and `Drives.stopped`.
        on_axis_stopped: Reaction if the core stops a required axis without a request. "raise":
            DriveError. "event": only the event `AxisStopped`; see `Drives.stopped`.
        on_return: Reaction if an optional device returns. "restore": replay its start-up objects
            and bring it to OP. "hold": keep it in PRE-OP until `Loop.restore`.
        on_replacement: Reaction if another device of the same product is in the place of an
            optional device, "restore" or "hold". "hold" does not even bring it to PRE-OP.

    Raises:
        ValueError: An option is impossible.
    """

    late_limit: float | None = None
    handover: float = HANDOVER
    command_timeout: float | None = None
    stop_deadline: float = 2.0
    lost_limit: int = 3
    raise_faults: bool = True
    on_axis_stopped: AxisStopReaction = "raise"
    on_return: ReturnPolicy = "restore"
    on_replacement: ReturnPolicy = "hold"

    def __post_init__(self) -> None:
        if self.late_limit is not None and not 0 <= self.late_limit < math.inf:
            raise ValueError(
                f"late_limit={self.late_limit} s: must be 0 (never) or a positive time"
            )
        if not 0 < self.handover < math.inf:
            raise ValueError(f"handover={self.handover} s: must be positive and finite")
        if not 0 <= self.stop_deadline < math.inf:
            raise ValueError(f"stop_deadline={self.stop_deadline} s: must be 0 or a positive time")
        check_count("lost_limit", self.lost_limit, 1)
        if self.command_timeout is not None and not 0 < self.command_timeout < math.inf:
            raise ValueError(
                f"command_timeout={self.command_timeout} s: must be positive and finite"
            )
        one_of("on_axis_stopped", self.on_axis_stopped, ("raise", "event"))
        one_of("on_return", self.on_return, ("restore", "hold"))
        one_of("on_replacement", self.on_replacement, ("restore", "hold"))

    @property
    def late_limits(self) -> tuple[float, float, float]:
        """Late limits in CSP, CSV and CST [s]."""
        if self.late_limit is None:
            return LATE_LIMIT_POSITION, LATE_LIMIT_VELOCITY, LATE_LIMIT_TORQUE
        return (self.late_limit,) * 3

    @property
    def command_timeouts(self) -> tuple[float, float]:
        """Command timeouts in CSV and CST [s]."""
        if self.command_timeout is None:
            return COMMAND_TIMEOUT_VELOCITY, COMMAND_TIMEOUT_TORQUE
        return (self.command_timeout,) * 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheduling:
    """Options of a loop for sleeping, for receiving frames and for several networks.

    Args:
        receive: Method of receiving frames. "poll": sleep until the deadline, then take the frames
            that have arrived. "wait": sleep until a frame arrives. "busy": check for frames without
            sleeping. None: "wait" when threaded, "poll" when inline.
        busy_wait: Time of a busy-wait before each cycle start [s]. The thread sleeps until then.
            The busy-wait costs this processor time in each cycle.
        switch_interval: Switch interval of the interpreter while an inline loop is open in real
            time [s]. None: unchanged; see `interpreter` in `Loop.timing`.
        collect_deadline: If threaded, share of the period in which frames may return. The budget of
            a law shortens it.
        exact_matching: True: every cyclic frame carries the cycle number in a NOP datagram. A frame
            that a loop in the wiring or a second sender repeats is then never accepted as a current
            one. It costs 16 bytes and 1.3 us of wire time per frame.
        quorum: Number of networks that must be good for a cycle to be good. None: all.

    Raises:
        ValueError: An option is impossible.
    """

    receive: ReceiveMode | None = None
    busy_wait: float = 0.0
    switch_interval: float | None = None
    collect_deadline: float = 0.8
    exact_matching: bool = False
    quorum: int | None = None

    def __post_init__(self) -> None:
        one_of("receive", self.receive, (None, "poll", "wait", "busy"))
        if not 0 <= self.busy_wait < math.inf:
            raise ValueError(f"busy_wait={self.busy_wait} s: must be 0 or a positive time")
        if self.switch_interval is not None and not 1e-6 <= self.switch_interval <= 1.0:
            raise ValueError(f"switch_interval={self.switch_interval} s: must be 1 us to 1 s")
        if not 0 < self.collect_deadline <= 1:
            raise ValueError(
                f"collect_deadline={self.collect_deadline}: must be a share of the period, 0 to 1"
            )
        if self.quorum is not None:
            check_count("quorum", self.quorum, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOptions:
    """Synchronisation of distributed clocks, for requests with `dc=`.

    Args:
        lead: Clock that gives the time. "reference": the cycle start follows the reference clock.
            "main": the reference clock follows the MainDevice. None: "reference"; with several
            networks "main", the only possible value.
        reference: Device with the reference clock. None: the first device with a clock.
        margin: Latest time of the frames after the cycle start [s]. None: 20 % of the period when
            threaded, 50 % when inline.
        burst: Number of frames that synchronise the clocks before the cycle begins.
        external: Clock outside of the segment that the cycle starts follow, such as "/dev/ptp0".
            Distributed clocks then follow the MainDevice. It does not need `dc=`.

    Raises:
        ValueError: An option is impossible.
        TypeError: `reference` is not a SubDevice, or `external` is not a clock.
    """

    lead: FollowedClock | None = None
    reference: SubDevice | None = None
    margin: float | None = None
    burst: int = BURST
    external: ExternalClock | str | None = None

    def __post_init__(self) -> None:
        one_of("lead", self.lead, (None, "reference", "main"))
        if self.reference is not None and not isinstance(self.reference, SubDevice):
            raise TypeError(f"reference={self.reference!r}: must be a SubDevice, such as subs[0]")
        if self.margin is not None and not 0 <= self.margin < math.inf:
            raise ValueError(f"margin={self.margin} s: must be 0 or a positive time")
        check_count("burst", self.burst, 0)
        self._check_external()

    @property
    def followed(self) -> FollowedClock:
        """Clock that gives the time of distributed clocks."""
        return self.lead or ("reference" if self.external is None else "main")

    @property
    def external_clock(self) -> ExternalClock | None:
        """External clock with its options; None without one."""
        return ExternalClock(self.external) if isinstance(self.external, str) else self.external

    def _check_external(self) -> None:
        if isinstance(self.external, str):
            require_name("external", self.external)
        external = self.external_clock
        if external is None:
            return
        if not isinstance(external, ExternalClock):
            raise TypeError(f"external={external!r}: must be a path or a cat.ExternalClock(...)")
        if self.lead == "reference":
            raise ValueError(
                'external= needs lead="main": the cycle starts cannot follow two clocks'
            )


def check_count(name: str, value: int, least: int) -> None:
    """Raise ValueError unless a value is an integer and at least `least`.

    Args:
        name: Name for the error message.
        value: Value to check.
        least: Smallest allowed value.
    """
    if not isinstance(value, Integral) or value < least:
        raise ValueError(f"{name}={value}: must be a whole number, at least {least}")


def check_groups(stop: StopPolicy, scheduling: Scheduling, clocks: ClockOptions) -> None:
    """Raise TypeError if a group of options has the wrong type.

    Args:
        stop: Stop conditions.
        scheduling: Scheduling options.
        clocks: Clock options.
    """
    for name, value, kind in (
        ("stop", stop, StopPolicy),
        ("scheduling", scheduling, Scheduling),
        ("clocks", clocks, ClockOptions),
    ):
        if not isinstance(value, kind):
            raise TypeError(f"{name}={value!r}: must be a cat.{kind.__name__}(...)")


def one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    """Raise ValueError for a value that is not allowed.

    Args:
        name: Name for the error message.
        value: Value to check.
        allowed: Allowed values.
    """
    if value not in allowed:
        names = ", ".join(f'"{each}"' for each in allowed if each is not None)
        raise ValueError(f"{name}={value!r}: must be one of {names}")
