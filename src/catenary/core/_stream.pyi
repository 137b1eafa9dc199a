"""Set-points that wait for their instants."""

class Stream:
    """A ring of at most `capacity` rows of set-points for `axes` axes: position [rad], velocity
    [rad/s] and torque [N·m] of all axes, one behind the other. One thread writes. ValueError."""

    def __init__(self, axes: int, capacity: int) -> None: ...
    def write(self, rows: bytes, seen: int) -> int:
        """Rows of 3·axes float64. How many found room. `seen`: the cycle whose actual values the
        writer had read: a position counts only for axes that were followed by then."""

    @property
    def waiting(self) -> int: ...
    @property
    def taken(self) -> int: ...
    @property
    def capacity(self) -> int: ...
    @property
    def dry(self) -> int:
        """Instants without a row since the first one was taken."""
