"""The mutex of mutex.h, in a buffer."""

MUTEX_SIZE: int

class SharedMutex:
    """A mutex at `offset` of a buffer; `fresh`: it is made there. ValueError: there is none."""

    def __init__(self, memory: object, offset: int, *, fresh: bool = False) -> None: ...
    def lock(self, timeout_ns: int) -> bool | None:
        """Waits without the GIL. False: it is ours; True: and whoever had it has died; None: the time
        has passed. RuntimeError: this thread has it already. Signal handlers run meanwhile."""

    def unlock(self) -> None:
        """RuntimeError: this thread does not have it."""
