"""Limits of the rates of requests and messages."""

from __future__ import annotations

RATE = 200.0  # requests of all clients per second
BURST = 40.0  # requests that may arrive at once after a pause


class RateLimit:
    """Token bucket. The time is an argument.

    Args:
        rate: Requests per second.
        burst: Requests that may arrive at once after a pause.
    """

    def __init__(self, rate: float = RATE, burst: float = BURST) -> None:
        self._rate = rate
        self._burst = burst
        self._left = burst
        self._time: float | None = None

    def wait_for(self, now: float) -> float:
        """Take one request. Return 0, or the time until the next one is allowed [s].

        Args:
            now: Present time [s].
        """
        passed = 0.0 if self._time is None else max(now - self._time, 0.0)
        self._time = now
        self._left = min(self._left + passed * self._rate, self._burst)
        if self._left >= 1.0:
            self._left -= 1.0
            return 0.0
        return (1.0 - self._left) / self._rate
