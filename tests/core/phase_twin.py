"""The phase controller in Python, written from docs/explanation/distributed_clocks.md: it and
the compiled one judge each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from catenary.plan.cycle import ClockPlan


@dataclass
class Twin:
    plan: ClockPlan
    period: int
    seeking: bool = True
    waits: int = 0
    strays: int = 0
    drift: float = 0.0
    rest: float = 0.0
    time_constant: float = 16.0  # [cycles]
    jumps: int = 0

    def step(self, error: int | None) -> int:
        if error is None:
            return 0 if self.seeking else self._whole(self.drift)
        if self.seeking:
            return self._seek(error)
        if self.waits:
            self.waits -= 1
            return self._whole(self.drift)
        if abs(error) > self.plan.step_ns and self.strays < 8:
            self.strays += 1
            self.jumps += self.strays == 8
            return self._whole(self.drift)
        if abs(error) <= self.plan.step_ns:
            self.strays = 0
        wanted = self.drift - 2 / self.time_constant * error
        limit = self.plan.rate_limit_ns
        applied = max(-limit, min(limit, wanted))
        if applied == wanted or (wanted > 0) == (error > 0):
            limit = self.plan.drift_limit_ns
            drift = self.drift - error / self.time_constant**2
            self.drift = max(-limit, min(limit, drift))
        self.time_constant = min(self.time_constant + 0.25, 1 / self.plan.bandwidth)
        return self._whole(applied)

    def _seek(self, error: int) -> int:
        self.seeking, self.waits, self.strays = False, 2, 0
        self.time_constant = min(16.0, 1 / self.plan.bandwidth)
        return -error if error <= 0 else self.period - error

    def _whole(self, by: float) -> int:
        self.rest += by
        whole = math.trunc(self.rest)
        self.rest -= whole
        return whole
