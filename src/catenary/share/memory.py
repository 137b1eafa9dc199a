"""Shared memory: files that are complete before they get their name, and sealed memory.

Not multiprocessing.shared_memory, whose readers remove the segment when they end (until 3.13).
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

MFD_NOEXEC_SEAL = 0x0008  # linux/memfd.h, from Linux 6.3: asked for where vm.memfd_noexec is 2
SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL


class Segment:
    """Owner of a mapping of a file; has the file's size, inode and owner."""

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
        """True if the name still belongs to this file."""
        try:
            return os.stat(self.path).st_ino == self.inode
        except FileNotFoundError:
            return False

    def publish(self, under: Path) -> None:
        """Rename the draft. It replaces a file of this name; readers of that file keep it."""
        self.path.rename(under)
        self.path = under

    def unlink(self) -> None:
        """Remove the name if it still belongs to this file."""
        # If another process keeps the lock, the file stays, as after a kill.
        with suppress(ShareError), deciding(self.path.parent):
            if self.is_published:
                self.path.unlink()


def create(folder: Path, size: int, mode: int) -> Segment:
    """Create a draft of zeros in a prepared folder. Raises ShareError if the memory is full."""
    remove_old_drafts(folder)
    draft = draft_path(folder)
    descriptor = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        os.posix_fallocate(descriptor, 0, size)  # a missing page would be a SIGBUS in a cycle
        os.fchmod(descriptor, mode)
    except OSError as error:
        os.close(descriptor)
        draft.unlink()
        if error.errno != errno.ENOSPC:
            raise
        raise ShareError(
            f"{folder} has no room for {size / 2**20:.1f} MiB",
            hint="less history=, or `mount -o remount,size=...`; in a container --shm-size",
        ) from error
    return Segment(draft, descriptor, writable=True)


def open_segment(
    path: Path, owners: Collection[int], *, writable: bool = False, granted: int | None = None
) -> Segment:
    """Map an existing file.

    Args:
        path: the file.
        owners: user ids whose files are accepted.
        writable: map it for writing, too.
        granted: permissions of others that are accepted; None: any.

    Raises:
        FileNotFoundError, PermissionError: from the kernel.
        ShareError: not a file of these owners, more users than `granted` may write, or empty.
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
    """Refuse a file before anything in it is trusted."""
    if status.st_uid not in owners:
        raise not_trusted(path, status.st_uid)
    if not stat.S_ISREG(status.st_mode) or status.st_size == 0:
        kind = "empty" if stat.S_ISREG(status.st_mode) else "not a regular file"
        raise ShareError(f"{path} is {kind}")
    mode = stat.S_IMODE(status.st_mode)
    if granted is not None and mode & 0o022 & ~granted:
        raise ShareError(
            f"{path} has mode {mode:#o}: more users can write there than you asked for",
            hint=f"mode={mode:#o}, if you trust them",
        )


def make_sealed(name: str, size: int) -> tuple[int, mmap.mmap]:
    """Create anonymous memory that no process can shrink or grow: reading it cannot fault.

    Returns its descriptor, which the caller owns, and a mapping.
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
    """Map memory that another process has made, and close the descriptor.

    Raises ShareError if it is not sealed or has another size.
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
    except OSError as error:  # F_GET_SEALS of another kind of file
        raise ShareError(f"no memory for commands: {error.strerror}") from error
    finally:
        os.close(descriptor)


def _memfd(name: str) -> int:
    flags = os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING
    try:
        return os.memfd_create(name, flags | MFD_NOEXEC_SEAL)
    except OSError as error:
        if error.errno != errno.EINVAL:  # before Linux 6.3
            raise
    return os.memfd_create(name, flags)
