"""Mutex: mutual exclusion among processes, for slow paths."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from catenary.errors import ShareError
from catenary.share import folder, memory
from catenary.share._mutex import MUTEX_SIZE, SharedMutex

FOR_EVER_NS = 1 << 62


class Mutex:
    """A lock that all threads of all processes share by its name.

        with share.Mutex("tool") as mutex:
            if mutex.recovered:       # the owner died in its block: its work may be half done
                ...

    The owner inherits the priority of its waiters. If the owner dies, the next one gets the lock,
    and `recovered` is True. It is for slow paths: a loop never waits for it. The first process that
    names it creates it; it stays until `unlink`.

    A process that has a mutex can crash the others, because it holds pointers of the C library.
    Share it only with users whom you trust. It is refused if another user owns it, or if more users
    may write in it than `mode` grants. `uid`: open the existing mutex of this user.
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
            raise ShareError(f"there is no mutex {name!r} of user {uid}") from error
        except ValueError as error:
            raise ShareError(f"the mutex {name!r}: {error}") from error

    def acquire(self, timeout: float | None = None) -> bool:
        """Acquire the lock. Return False after `timeout` [s].

        Raises RuntimeError if this thread already has it.
        """
        recovered = self._mutex.lock(FOR_EVER_NS if timeout is None else round(timeout * 1e9))
        if recovered is None:
            return False
        self.recovered = recovered
        return True

    def release(self) -> None:
        """Release the lock. Raises RuntimeError if this thread does not have it."""
        self._mutex.unlock()

    def unlink(self) -> None:
        """Remove the name. Processes that have the mutex keep it."""
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
