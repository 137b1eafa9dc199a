"""Set-points written in advance of their cycle starts."""

class Stream:
    """Ring of set-points: one row per cycle start. One thread writes.

    A row contains position [rad], velocity [rad/s] and torque [N·m] of all axes, in this order.

    Args:
        axes: Number of axes.
        capacity: Maximum number of rows.

    Raises:
        ValueError: A number is out of range.
    """

    def __init__(self, axes: int, capacity: int) -> None: ...
    def write(self, rows: bytes, seen: int) -> int:
        """Append as many rows as there is room for; return their number.

        Args:
            rows: Rows of 3·axes float64.
            seen: The cycle whose actual values the writer had read. A position is valid only for
                axes that were followed in that cycle.

        Raises:
            ValueError: The size is not a multiple of a row.
        """

    @property
    def waiting(self) -> int: ...
    @property
    def taken(self) -> int: ...
    @property
    def capacity(self) -> int: ...
    @property
    def dry(self) -> int:
        """Number of cycles without a row since the first row was taken."""
