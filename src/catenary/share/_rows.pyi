"""Rings of rows in shared memory. See ring.h for the theory of operation."""

def memory_size(count: int, size: int) -> int:
    """Return the memory size [bytes] of a ring of `count` rows of `size` bytes."""

def row_parts(record_size: int, actual_size: int, target_size: int) -> tuple[int, int, int, int]:
    """Return the offsets of record, actual values and targets in a row, and its size [bytes]."""

class Ring:
    """A ring of `count` rows (a power of two) of `size` bytes, at byte `offset` of a buffer.

    Raises ValueError if the ring does not fit in the buffer, or if a value is invalid.
    """

    def __init__(
        self, memory: object, offset: int, count: int, size: int, *, writable: bool = False
    ) -> None: ...
    @property
    def newest(self) -> int:
        """Number of the last row; 0 before the first row."""

    @property
    def ended(self) -> bool:
        """True if no more rows will come."""

    def copy(self) -> tuple[int, bytes]:
        """Return the number of the newest row (0 before the first row) and its bytes."""

    def copy_after(self, after: int) -> tuple[bytearray, int]:
        """Return the rows after row `after` that still exist, oldest first.

        Also return how many rows between `after` and the last returned row were overwritten.
        """

    def wait(self, seen: int, deadline_ns: int) -> bool:
        """Sleep without the GIL until row `seen` has a successor. Signal handlers still run.

        Return False if the deadline [ns, CLOCK_MONOTONIC] passes or the ring ends first.
        """

    def write(self, row: bytes) -> None:
        """Append a row, padded with zeros. Only one thread may call this at a time.

        Raises ValueError if the row is too long or the memory is read-only.
        """

    def end(self) -> None:
        """Mark the ring as ended and wake all readers. No more rows will come.

        Raises ValueError if the memory is read-only.
        """

class CycleWriter(Ring):
    """A ring whose rows are the cycles of an engine.

    `sizes` contains the sizes of the record, the actual values and the targets [bytes].
    """

    def __init__(
        self,
        memory: object,
        offset: int,
        count: int,
        size: int,
        sizes: tuple[int, int, int],
        *,
        writable: bool,
        motion: tuple[object, int, int] | None = None,
        jog: bool = False,
    ) -> None:
        """Make a writer.

        `motion`: memory of the motion words (native/motion.h), their offset, and the number of axes.
        `jog`: the core accepts jogs.
        """

    @property
    def capsule(self) -> object:
        """Capsule of the sink table; it keeps the writer and its memory alive."""
