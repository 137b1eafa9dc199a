"""Decision of the safety task: the robot may move, brakes with its joints, or stops.

A decision is never withdrawn. The joints brake for `Rules.brake` seconds, so that the robot sinks
instead of falling stiffly. Then the drives stop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from exchange import Cause, Mode, Verdict


@dataclass(frozen=True)
class Rules:
    """Limits of the decision.

    Args:
        tilt: tilt of the pelvis at which the robot counts as fallen [rad].
        silence: age of the newest value of a task [s].
        lost: time without a drive or the IMU [s].
        brake: time from the first decision to the stop [s].
    """

    tilt: float = 0.45
    silence: float = 0.010
    lost: float = 0.005
    brake: float = 1.0


class Safety:
    """Owner of the decision so far. Call `step` once per job."""

    def __init__(self, rules: Rules = Rules()) -> None:
        self.verdict, self.cause = Verdict.GO, Cause.NONE
        self._rules = rules
        self._since: float | None = None  # [s] time of the first decision
        self._losses = {Cause.LOST_DRIVE: 0.0, Cause.LOST_IMU: 0.0}  # [s] how long

    def step(
        self, now: float, dt: float, state: np.ndarray, tilt: float, ages: Mapping[Cause, float]
    ) -> Verdict:
        """Return the decision.

        Args:
            now: time of the job [s].
            dt: time since the previous job [s].
            state: newest `STATE`.
            tilt: estimated tilt of the pelvis [rad].
            ages: age of the newest value of each watched task [s].
        """
        cause = self._cause(dt, state, tilt, ages)
        if self._since is None and cause is not None:
            self.verdict, self.cause, self._since = Verdict.DAMP, cause, now
        if self._since is not None and now - self._since >= self._rules.brake:
            self.verdict = Verdict.STOP
        return self.verdict

    def _cause(
        self, dt: float, state: np.ndarray, tilt: float, ages: Mapping[Cause, float]
    ) -> Cause | None:
        if state["mode"] == Mode.DAMPING:
            return None  # the joints brake anyway
        for cause, there in (
            (Cause.LOST_DRIVE, state["drives_valid"].all()),
            (Cause.LOST_IMU, state["imu_valid"]),
        ):
            self._losses[cause] = 0.0 if there else self._losses[cause] + dt
            if self._losses[cause] > self._rules.lost:
                return cause
        silent = (cause for cause, age in ages.items() if age > self._rules.silence)
        if (cause := next(silent, None)) is not None:
            return cause
        is_free = not state["held"]
        return Cause.FALLEN if is_free and not tilt <= self._rules.tilt else None
