"""Limits of a policy's action, and a stated reaction to bad, missing or late actions.

The rule of `ActionRule`, where the age is the time since the last good action:

| age | action |
|---|---|
| at most `hold` | the last good action |
| up to `hold + decay` | linear from the last good action to `neutral` |
| longer, or before the first good action | `neutral` |

An action is good if it has the shape (outputs,) or (1, outputs) and all of its values are finite.
It is saturated at `low` and `high`. The result then changes by at most `rate` per second, also
when the action is held, decays or returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row
from catenary.control.parts import PerAxis, axis_count, checked

ROUNDING = 1e-9  # [s], of differences of times
Phase = Literal["ok", "held", "decaying", "neutral"]


@dataclass(frozen=True)
class ActionRule:
    """Limits of the actions of a policy, and the fallback for bad or late actions.

    Most options are one value, or one per output. Their unit is that of the action.

    Args:
        outputs: number of values of an action, m.
        low: smallest action.
        high: largest action.
        neutral: action without a usable policy, such as zero corrections; within the limits.
        rate: largest change of an action [unit/s].
        hold: time for which the last good action is kept [s].
        decay: time in which a kept action then changes to the neutral action [s].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.
    """

    outputs: int
    low: PerAxis
    high: PerAxis
    neutral: PerAxis = 0.0
    rate: PerAxis = math.inf
    hold: float = 0.03
    decay: float = 0.1

    def __post_init__(self) -> None:
        n = axis_count(self.outputs)
        low, neutral, high = self.rows
        for i, (least, value, most) in enumerate(zip(low, neutral, high, strict=True)):
            if not (least <= value <= most and math.isfinite(value)):
                raise ValueError(
                    f"neutral of output {i} is {value}; it must be finite, and within {least} to "
                    f"{most}"
                )
        checked("rate", self.rate, n, above=True)
        for name in ("hold", "decay"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name}={getattr(self, name)} is not a time of at least 0 s")

    @property
    def rows(self) -> tuple[Row, Row, Row]:
        """Smallest, neutral and largest action, each (m,)."""
        n, least = self.outputs, -math.inf
        low = checked("low", self.low, n, least=least)
        neutral = checked("neutral", self.neutral, n, least=least)
        return low, neutral, checked("high", self.high, n, least=least)

    def weight(self, age: float) -> float:
        """Return the weight of the last good action at an age [s]: 1 held, 0 neutral."""
        beyond = age - self.hold
        if beyond <= ROUNDING:
            return 1.0
        return 1.0 - beyond / self.decay if beyond < self.decay else 0.0


@dataclass(frozen=True, slots=True)
class ActionStatus:
    """State of a policy's action.

    Args:
        phase: "ok", "held", "decaying" or "neutral" (see `catenary.control.action_rule`).
        reason: cause of the last refused or missing action; empty if the phase is "ok".
        age: time since the last good action [s]; infinite before the first one.
        accepted: number of good actions.
        refused: number of bad actions.
    """

    phase: Phase
    reason: str
    age: float
    accepted: int
    refused: int

    def __str__(self) -> str:
        if self.phase == "ok":
            return f"ok: {self.accepted} actions, {self.refused} refused"
        return f"{self.phase}: {self.reason}; {self.refused} refused"


class ActionGuard:
    """The current action under a rule. `Policy` and `ActionReader` use it."""

    def __init__(self, rule: ActionRule) -> None:
        self.rule = rule
        self._low, self._neutral, self._high = rule.rows
        rate = checked("rate", rule.rate, rule.outputs)
        self._unlimited = np.isinf(rate)
        self._rate = np.where(self._unlimited, 0.0, rate)
        self._good = self._action = self._neutral
        self._good_time: float | None = None
        self._time: float | None = None
        self._settled = math.nan  # weight for which the action needs no further change
        self._accepted = self._refused = 0
        self._reason = "no action yet"

    def accept(self, values: npt.ArrayLike, now: float) -> None:
        """Take a new action, if it is good. Otherwise count it as refused.

        Args:
            values: action of the policy.
            now: current time [s].
        """
        try:
            action = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            self.refuse(f"the output is not numeric: {error}")
            return
        reason = fault(action, self.rule.outputs)
        if reason:
            self.refuse(reason)
            return
        self._good = np.clip(action.reshape(-1), self._low, self._high)
        self._good_time = now
        self._settled = math.nan
        self._accepted += 1
        self._reason = ""

    def refuse(self, reason: str) -> None:
        """Count a bad action. `reason` appears in the status."""
        self._refused += 1
        self._reason = reason

    def action(self, now: float) -> Row:
        """Return the action (m,) at the time `now` [s]."""
        weight = self.rule.weight(self._age(now))
        if weight != self._settled:
            self._advance(weight, 0.0 if self._time is None else max(0.0, now - self._time))
        self._time = now
        return self._action.copy()

    def _advance(self, weight: float, passed: float) -> None:
        """Move the action towards that of the rule, by at most the rate times `passed` [s]."""
        aim = weight * self._good + (1.0 - weight) * self._neutral
        reach = np.where(self._unlimited, math.inf, self._rate * passed)
        self._action = np.clip(aim, self._action - reach, self._action + reach)
        if np.array_equal(self._action, aim):
            self._settled = weight

    def status(self, now: float) -> ActionStatus:
        """Return the state of the action at the time `now` [s]."""
        age = self._age(now)
        phase = self._phase(age)
        late = "" if phase == "ok" else f"no good action for {age:.3g} s"
        return ActionStatus(phase, self._reason or late, age, self._accepted, self._refused)

    def _age(self, now: float) -> float:
        return math.inf if self._good_time is None else max(0.0, now - self._good_time)

    def _phase(self, age: float) -> Phase:
        weight = self.rule.weight(age)
        if weight == 0.0:
            return "neutral"
        if weight < 1.0:
            return "decaying"
        return "held" if self._reason else "ok"


def checked_time(now: float) -> float:
    """Return `now`.

    Raises ValueError if it is not finite, since no action would ever be too old then.
    """
    if not math.isfinite(now):
        raise ValueError(f"now={now} is not a time; give seconds of a clock that only advances")
    return now


def fault(action: npt.NDArray[Any], outputs: int) -> str:
    """Return the reason to refuse an action; empty if it is good."""
    if action.shape not in ((outputs,), (1, outputs)):
        return f"the output has shape {action.shape}, expected ({outputs},)"
    bad = np.flatnonzero(~np.isfinite(action))
    if len(bad):
        return f"output {bad[0]} of {outputs} is {action.ravel()[bad[0]]}"
    return ""


class LatestValue(Protocol):
    """The latest array of another task, such as a `realtime.Value`."""

    @property
    def number(self) -> int:
        """Number of writes."""
        ...

    def read(self) -> npt.NDArray[Any]:
        """Return the latest array."""
        ...


class ActionReader:
    """The action that a policy in another task writes, with the fallback for a late policy.

    A task runs the policy, and writes each action to a `realtime.Value`. The loop reads it here.
    The age counts from the read that first returns a new value, on the clock of the reader. The
    clocks of both need not agree.

    Args:
        value: `realtime.Value("f8", m)` of the actions.
        rule: limits and fallback.
    """

    def __init__(self, value: LatestValue, rule: ActionRule) -> None:
        self._value = value
        self._guard = ActionGuard(rule)
        self._number = 0
        self._now = 0.0

    def read(self, now: float) -> Row:
        """Return the action (m,) at the time `now` [s], on any clock that only advances.

        Raises ValueError if `now` is not finite.
        """
        self._now = checked_time(now)
        number = self._value.number
        if number != self._number:
            self._number = number
            self._guard.accept(self._value.read(), now)
        return self._guard.action(now)

    @property
    def status(self) -> ActionStatus:
        """State of the action at the last read."""
        return self._guard.status(self._now)
