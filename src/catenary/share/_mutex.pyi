"""The mutex of mutex.h, in a buffer."""

MUTEX_SIZE: int

class SharedMutex:
    """A mutex at `offset` of a buffer; `fresh`: initialise it. Raises ValueError if invalid."""

    def __init__(self, memory: object, offset: int, *, fresh: bool = False) -> None: ...
    def lock(self, timeout_ns: int) -> bool | None:
        """Wait for the mutex without the GIL. Signal handlers run meanwhile.

        Return False if acquired, True if acquired from an owner that died, None at the timeout.
        Raises RuntimeError if this thread already has it.
        """

    def unlock(self) -> None:
        """Release the mutex. Raises RuntimeError if this thread does not have it."""
