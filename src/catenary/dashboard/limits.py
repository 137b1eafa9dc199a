"""Limit of the rate of messages or requests (token bucket)."""

from __future__ import annotations

import time
from collections.abc import Callable


class RateLimit:
    """Bucket that allows `rate` uses per second, and at most `burst` at once.

    Args:
        rate: uses per second.
        burst: uses at once.
        clock: monotonic clock [s].
    """

    def __init__(
        self, rate: float, burst: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = rate
        self._burst = float(burst)
        self._left = float(burst)
        self._clock = clock
        self._last = clock()

    def use(self) -> bool:
        """Count one use. Return False if it exceeds the limit."""
        now = self._clock()
        self._left = min(self._burst, self._left + (now - self._last) * self._rate)
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
