"""Shared memory: files that are complete before they are visible by name, and sealed memory.

multiprocessing.shared_memory is not suitable: before Python 3.13, a reader that exits removes the
segment.
"""

from __future__ import annotations

import errno
import fcntl
import mmap
import os
import stat
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from catenary.errors import ShareError
from catenary.share.folder import deciding, draft_path, not_trusted, remove_old_drafts

MFD_NOEXEC_SEAL = 0x0008  # linux/memfd.h, since Linux 6.3; required if vm.memfd_noexec is 2
SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL


class Segment:
    """Owner of the mapping of a file, with the file's size, inode and user id.

    The constructor maps the whole file and closes the descriptor.
    """

    def __init__(self, path: Path, descriptor: int, *, writable: bool) -> None:
        try:
            status = os.fstat(descriptor)
            self.path = path
            self.size = status.st_size
            self.inode = status.st_ino
            self.owner = status.st_uid
            prot = mmap.PROT_READ | (mmap.PROT_WRITE if writable else 0)
            flags = mmap.MAP_SHARED | (mmap.MAP_POPULATE if writable else 0)
            self.memory = mmap.mmap(descriptor, self.size, flags=flags, prot=prot)
        finally:
            os.close(descriptor)

    @property
    def is_published(self) -> bool:
        """True if the path still refers to this file."""
        try:
            return os.stat(self.path).st_ino == self.inode
        except FileNotFoundError:
            return False

    def publish(self, under: Path) -> None:
        """Rename the draft to `under`. Readers of a file that it replaces keep their mapping."""
        self.path.rename(under)
        self.path = under

    def unlink(self) -> None:
        """Lock the folder, and remove the file if the path still refers to it."""
        # If another process holds the lock for too long, the file remains, as after a kill.
        with suppress(ShareError), deciding(self.path.parent):
            if self.is_published:
                self.path.unlink()


def create(folder: Path, size: int, mode: int) -> Segment:
    """Create a draft file of zeros in a prepared folder.

    Args:
        folder: the folder.
        size: size of the file [bytes].
        mode: permissions as for chmod.

    Raises:
        ShareError: the file system is full.
    """
    remove_old_drafts(folder)
    draft = draft_path(folder)
    descriptor = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        os.posix_fallocate(descriptor, 0, size)  # a missing page would raise SIGBUS in a cycle
        os.fchmod(descriptor, mode)
    except OSError as error:
        os.close(descriptor)
        draft.unlink()
        if error.errno != errno.ENOSPC:
            raise
        raise ShareError(
            f"not enough space in {folder}: {size / 2**20:.1f} MiB needed",
            hint="reduce history=, or enlarge the file system with `mount -o remount,size=...` (in "
            "a container: --shm-size)",
        ) from error
    return Segment(draft, descriptor, writable=True)


def open_segment(
    path: Path, owners: Collection[int], *, writable: bool = False, granted: int | None = None
) -> Segment:
    """Map an existing file.

    Args:
        path: the file.
        owners: user ids whose files are accepted.
        writable: True maps the file for writing, too.
        granted: mode that limits the accepted write permissions of other users; None: no limit.

    Raises:
        FileNotFoundError: the file does not exist.
        PermissionError: this user must not open the file.
        ShareError: the file is empty or not a regular file, has another owner, or is writable for
            more users than `granted` permits.
    """
    access = os.O_RDWR if writable else os.O_RDONLY
    try:
        descriptor = os.open(path, access | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (FileNotFoundError, PermissionError):
        raise
    except OSError as error:
        raise ShareError(f"{path} is not a share: {error.strerror}") from error
    try:
        check_status(path, os.fstat(descriptor), owners, granted)
    except BaseException:
        os.close(descriptor)
        raise
    return Segment(path, descriptor, writable=writable)


def check_status(
    path: Path, status: os.stat_result, owners: Collection[int], granted: int | None
) -> None:
    """Check owner, type, size and mode of a file before its content is trusted.

    Args:
        path: the file, for messages.
        status: its status.
        owners: user ids whose files are accepted.
        granted: mode that limits the accepted write permissions of other users; None: no limit.

    Raises:
        ShareError: the file is not accepted.
    """
    if status.st_uid not in owners:
        raise not_trusted(path, status.st_uid)
    if not stat.S_ISREG(status.st_mode) or status.st_size == 0:
        kind = "empty" if stat.S_ISREG(status.st_mode) else "not a regular file"
        raise ShareError(f"{path} is {kind}")
    mode = stat.S_IMODE(status.st_mode)
    if granted is not None and mode & 0o022 & ~granted:
        raise ShareError(
            f"{path} has mode {mode:#o}: more users can write to it than mode={granted:#o} allows",
            hint=f"pass mode={mode:#o} if you trust these users",
        )


def make_sealed(name: str, size: int) -> tuple[int, mmap.mmap]:
    """Create anonymous memory that no process can resize, so that an access cannot fault.

    Args:
        name: name of the memory in /proc.
        size: size [bytes].

    Returns:
        The descriptor, which the caller owns, and a mapping.
    """
    descriptor = _memfd(name)
    try:
        os.posix_fallocate(descriptor, 0, size)
        fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, SEALS)
        memory = mmap.mmap(descriptor, size, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor, memory


def map_sealed(descriptor: int, size: int) -> mmap.mmap:
    """Map sealed memory of another process, and close the descriptor.

    Args:
        descriptor: descriptor of the memory.
        size: expected size [bytes].

    Raises:
        ShareError: the memory is not sealed, has another size, or cannot be mapped.
    """
    try:
        seals = fcntl.fcntl(descriptor, fcntl.F_GET_SEALS)
        found = os.fstat(descriptor).st_size
        if seals & SEALS != SEALS or found != size:
            raise ShareError(
                f"the memory for commands has {found} bytes and seals {seals:#x}; "
                f"expected {size} bytes and seals {SEALS:#x}"
            )
        return mmap.mmap(descriptor, size, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)
    except OSError as error:  # F_GET_SEALS fails for other kinds of files
        raise ShareError(f"cannot map the memory for commands: {error.strerror}") from error
    finally:
        os.close(descriptor)


def _memfd(name: str) -> int:
    flags = os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING
    try:
        return os.memfd_create(name, flags | MFD_NOEXEC_SEAL)
    except OSError as error:
        if error.errno != errno.EINVAL:  # EINVAL: Linux before 6.3
            raise
    return os.memfd_create(name, flags)
