"""Rings of rows in shared memory; ring.h has the theory of operation."""

def memory_size(count: int, size: int) -> int:
    """Return the memory size [bytes] of a ring of `count` rows of `size` bytes."""

def row_parts(record_size: int, actual_size: int, target_size: int) -> tuple[int, int, int, int]:
    """Return the offsets of a cycle's three blocks in its row, and the size of the row."""

class Ring:
    """A ring at `offset` of a buffer, of `count` rows (a power of two) of `size` bytes.

    Raises ValueError if it does not fit.
    """

    def __init__(
        self, memory: object, offset: int, count: int, size: int, *, writable: bool = False
    ) -> None: ...
    @property
    def newest(self) -> int:
        """Number of the last row; 0 before the first."""

    @property
    def ended(self) -> bool:
        """True if no more rows will come."""

    def copy(self) -> tuple[int, bytes]:
        """Return the number of the newest row, 0 if there is none yet, and the row."""

    def copy_after(self, after: int) -> tuple[bytearray, int]:
        """Return the rows after number `after` that still exist, oldest first.

        Also return the number of overwritten rows before the last of them.
        """

    def wait(self, seen: int, deadline_ns: int) -> bool:
        """Sleep without the GIL until there is a row after `seen`. Signal handlers run meanwhile.

        Return False if the deadline [CLOCK_MONOTONIC] or the end comes first.
        """

    def write(self, row: bytes) -> None:
        """Append a row, padded with zeros. Only one thread may call this at a time."""

    def end(self) -> None:
        """Mark the ring as ended: no more rows will come. Wake all readers."""

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
        """Capsule of the sink table; it keeps the writer and its memory alive."""
