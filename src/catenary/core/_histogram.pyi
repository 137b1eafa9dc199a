"""Histograms of times in fixed memory; mean, sd, min and max are exact.

A bucket is 1 ns wide below 512 ns, and at most 0.4 % of its value above.
"""

class Histogram:
    """Histogram of times that are measured outside the cycle."""

    def __init__(self) -> None: ...
    def add(self, value_ns: int) -> None:
        """Add a time [ns]; negative times count as 0."""

    def summary(self) -> dict[str, float]:
        """Return count, and mean, min, max, sd, p50, p99, p999 [s]; only count if empty."""

    def counts(self) -> list[tuple[float, float, int]]:
        """Return (lower [s], upper [s], count) for every bucket that is not empty."""
