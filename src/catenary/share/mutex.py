"""Mutual exclusion between processes, for slow paths."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from catenary.errors import ShareError
from catenary.share import folder, memory
from catenary.share._mutex import MUTEX_SIZE, SharedMutex

NO_TIMEOUT_NS = 1 << 62


class Mutex:
    """A named lock that threads of any process can share.

        with share.Mutex("tool") as mutex:
            if mutex.recovered:       # the previous owner died inside its block
                ...

    The owner inherits the priority of its waiters. If the owner dies, the next waiter acquires the
    lock, and `recovered` is True: the work of the owner may be incomplete. Use the mutex on slow
    paths only; a loop never waits for it. The first process that uses the name creates the mutex.
    It exists until `unlink`.

    A process that can write to a mutex can crash the others, because the mutex contains pointers
    of the C library. Share it only with users whom you trust.

    Args:
        name: name of the mutex.
        mode: permissions as for chmod.
        uid: the user whose existing mutex to open; None: open the mutex of this user, or create
            it.

    Raises:
        ShareError: another user owns the mutex, more users can write to it than `mode` grants, or
            user `uid` has no such mutex.
        ValueError: the name is invalid.
    """

    def __init__(self, name: str, *, mode: int = 0o600, uid: int | None = None) -> None:
        self.name = name
        self._file = folder.file_name(folder.MUTEX, name)
        self.recovered = False  # True if the last lock was taken from an owner that had died
        try:
            self.path, self._mutex = self._attached(mode, uid)
        except PermissionError as error:
            raise ShareError(
                f"the mutex {name!r} belongs to another user ({error.filename})",
                hint="its owner can allow it: Mutex(..., mode=0o660) for the group",
            ) from error
        except FileNotFoundError as error:
            raise ShareError(f"user {uid} has no mutex {name!r}") from error
        except ValueError as error:
            raise ShareError(f"cannot open the mutex {name!r}: {error}") from error

    def acquire(self, timeout: float | None = None) -> bool:
        """Acquire the lock. Return False if `timeout` [s] passes first; None waits without a limit.

        Raises RuntimeError if this thread already holds it, and OSError if the mutex is damaged.
        """
        recovered = self._mutex.lock(NO_TIMEOUT_NS if timeout is None else round(timeout * 1e9))
        if recovered is None:
            return False
        self.recovered = recovered
        return True

    def release(self) -> None:
        """Release the lock. Raises RuntimeError if this thread does not hold it."""
        self._mutex.unlock()

    def unlink(self) -> None:
        """Remove the name. Processes that have opened the mutex can still use it."""
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

    def _attached(self, mode: int, uid: int | None) -> tuple[Path, SharedMutex]:
        if uid is not None:
            return _opened(folder.find(self._file, uid), mode, uid)
        own = folder.own_folder()
        folder.prepare(own, mode)
        with folder.deciding(own):
            try:
                return _opened(own / self._file, mode, None)
            except FileNotFoundError:
                segment = memory.create(own, MUTEX_SIZE, mode)
                made = SharedMutex(segment.memory, 0, fresh=True)
                segment.publish(own / self._file)
                return segment.path, made


def _opened(path: Path, mode: int, uid: int | None) -> tuple[Path, SharedMutex]:
    owners = folder.trusted_owners(uid)
    segment = memory.open_segment(path, owners, writable=True, granted=mode)
    return path, SharedMutex(segment.memory, 0)
