"""Largest value of the last seconds, with amortised constant time per value."""

from __future__ import annotations

from collections import deque


class SlidingMaximum:
    """Owner of the values of a time window that can still become the maximum.

    Args:
        window_ns: length of the window [ns].
    """

    def __init__(self, window_ns: int) -> None:
        self._window_ns = window_ns
        self._falling: deque[tuple[int, int]] = deque()  # times rise, values fall

    def add(self, now_ns: int, value: int) -> None:
        """Add a value.

        Args:
            now_ns: time of the value, not before that of the last one [ns].
            value: the value.
        """
        falling = self._falling
        while falling and falling[-1][1] <= value:
            falling.pop()
        falling.append((now_ns, value))
        while falling[0][0] < now_ns - self._window_ns:
            falling.popleft()

    @property
    def value(self) -> int | None:
        """Largest value of the window that ends with the last value; None if empty."""
        return self._falling[0][1] if self._falling else None
