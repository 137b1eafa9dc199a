"""Python binding of the shared-memory mutex in mutex.h."""

MUTEX_SIZE: int

class SharedMutex:
    """A mutex at byte `offset` of a buffer. With `fresh`, the constructor initialises it.

    Raises ValueError if the mutex does not fit in the buffer, if `offset` is not a multiple of 64,
    or if the memory contains no mutex of this version.
    """

    def __init__(self, memory: object, offset: int, *, fresh: bool = False) -> None: ...
    def lock(self, timeout_ns: int) -> bool | None:
        """Wait for the mutex without the GIL. Signal handlers still run.

        Return False if acquired, True if acquired from an owner that died, None on timeout.
        Raises RuntimeError if this thread already holds it, and OSError if the mutex is damaged.
        """

    def unlock(self) -> None:
        """Release the mutex. Raises RuntimeError if this thread does not hold it."""
