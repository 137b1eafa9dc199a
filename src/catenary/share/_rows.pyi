"""Rings of rows in shared memory: ring.h says how."""

def memory_size(count: int, size: int) -> int:
    """Bytes of a ring of `count` rows of `size` bytes."""

def row_parts(record_size: int, actual_size: int, target_size: int) -> tuple[int, int, int, int]:
    """Where the three blocks of a cycle lie in its row, and the size of the row."""

class Ring:
    """A ring at `offset` of a buffer, of `count` rows (a power of two) of `size` bytes. ValueError: it
    cannot lie there."""

    def __init__(
        self, memory: object, offset: int, count: int, size: int, *, writable: bool = False
    ) -> None: ...
    @property
    def newest(self) -> int:
        """The number of the last row; 0: none yet."""

    @property
    def ended(self) -> bool:
        """No more rows will come."""

    def copy(self) -> tuple[int, bytes]:
        """The newest row and its number; 0: there is none."""

    def copy_after(self, after: int) -> tuple[bytearray, int]:
        """The rows behind `after` that are still there, oldest first, and how many are missing before
        the last of them."""

    def wait(self, seen: int, deadline_ns: int) -> bool:
        """Sleeps without the GIL until there is a row behind `seen`: True; or until the deadline
        [CLOCK_MONOTONIC] or the end: False. Signal handlers run meanwhile."""

    def write(self, row: bytes) -> None:
        """The next row, filled up with zeros. One thread at a time."""

    def end(self) -> None:
        """Says that no more rows will come, and wakes all who wait."""

class CycleWriter(Ring):
    """A ring whose rows are the cycles of an engine: `sizes` of its three blocks."""

    def __init__(
        self,
        memory: object,
        offset: int,
        count: int,
        size: int,
        sizes: tuple[int, int, int],
        *,
        writable: bool,
    ) -> None: ...
    @property
    def capsule(self) -> object:
        """The table of native/sink.h."""
