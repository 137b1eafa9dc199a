"""Mutex: one at a time, among processes, for slow paths."""

from __future__ import annotations

from types import TracebackType

from catenary.errors import ShareError
from catenary.share import memory
from catenary.share._mutex import MUTEX_SIZE, SharedMutex

FOR_EVER_NS = 1 << 62


class Mutex:
    """One at a time among all threads of all processes that name it.

        with share.Mutex("tool") as mutex:
            if mutex.recovered:       # who had it died in its block: what it did may be half done
                ...

    A waiter of high priority lends it to the owner (priority inheritance); the lock of an owner
    that has died goes to the next, who is told. For slow paths: a loop never waits for it. It is
    made by whoever names it first, with `mode` as its permissions, and stays until `unlink`.
    """

    def __init__(self, name: str, *, mode: int = 0o600) -> None:
        self.name = name
        self.path = memory.path_of(name, "mutex")
        self.recovered = False  # whether the last lock was taken from an owner that had died
        try:
            self._mutex = self._attached(mode)
        except PermissionError as error:
            raise ShareError(
                f"the mutex {name!r} belongs to another user", hint=f"see {self.path}"
            ) from error
        except ValueError as error:
            raise ShareError(f"{self.path}: {error}") from error

    def acquire(self, timeout: float | None = None) -> bool:
        """Waits for it, at most `timeout` [s]; whether it is ours. RuntimeError: it was already."""
        recovered = self._mutex.lock(FOR_EVER_NS if timeout is None else round(timeout * 1e9))
        if recovered is None:
            return False
        self.recovered = recovered
        return True

    def release(self) -> None:
        """RuntimeError: it is not this thread's."""
        self._mutex.unlock()

    def unlink(self) -> None:
        """Takes the name away; those who have the mutex keep it."""
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> Mutex:
        self.acquire()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def _attached(self, mode: int) -> SharedMutex:
        with memory.deciding():
            try:
                return SharedMutex(memory.open_segment(self.path, writable=True).memory, 0)
            except FileNotFoundError:
                segment = memory.create(self.path, MUTEX_SIZE, mode)
                made = SharedMutex(segment.memory, 0, fresh=True)
                segment.publish(self.path)
                return made
