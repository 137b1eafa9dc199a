"""Histograms of times in fixed memory: buckets at most 0.4 % wide; exact mean, sd, min, max."""

class Histogram:
    """Owns one histogram, for times measured outside the cycle."""

    def __init__(self) -> None: ...
    def add(self, value_ns: int) -> None:
        """Counts a time [ns]; negative ones count as 0."""

    def summary(self) -> dict[str, float]:
        """count, and mean, min, max, sd, p50, p99, p999 [s]; only count when empty."""

    def counts(self) -> list[tuple[float, float, int]]:
        """(lower, upper, count) of every bucket that is not empty [s]."""
