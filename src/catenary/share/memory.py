"""Segments by name: files in /dev/shm, made whole before anybody sees them.

Not multiprocessing.shared_memory, whose readers remove the segment when they end (until 3.13).
"""

from __future__ import annotations

import errno
import fcntl
import mmap
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catenary.errors import ShareError

FOLDER = Path("/dev/shm")
PREFIX = "catenary-"  # of shares; what belongs to them has "catenary." and a word
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def path_of(name: str, part: str = "") -> Path:
    """Where a segment lives, or what belongs to it. ValueError: not a name."""
    if not NAME.fullmatch(name):
        raise ValueError(
            f"share {name!r}: a name has up to 64 letters, digits, '.', '_' and '-', and begins "
            "with a letter or digit"
        )
    return FOLDER / (f"catenary.{part}-{name}" if part else f"{PREFIX}{name}")


def names() -> list[str]:
    """Of all segments there are."""
    return sorted(path.name.removeprefix(PREFIX) for path in FOLDER.glob(f"{PREFIX}*"))


@contextmanager
def deciding() -> Iterator[None]:
    """Nobody else creates or removes a segment meanwhile."""
    folder = os.open(FOLDER, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


class Segment:
    """Owns a mapping, and knows which file it is."""

    def __init__(self, path: Path, descriptor: int, *, writable: bool) -> None:
        try:
            status = os.fstat(descriptor)
            self.path = path
            self.size = status.st_size
            self.inode = status.st_ino
            prot = mmap.PROT_READ | (mmap.PROT_WRITE if writable else 0)
            flags = mmap.MAP_SHARED | (mmap.MAP_POPULATE if writable else 0)
            self.memory = mmap.mmap(descriptor, self.size, flags=flags, prot=prot)
        finally:
            os.close(descriptor)

    @property
    def is_published(self) -> bool:
        """Whether its name still means this one."""
        try:
            return os.stat(self.path).st_ino == self.inode
        except FileNotFoundError:
            return False

    def publish(self, under: Path) -> None:
        """Gives it its name; whatever had the name loses it, those who are attached keep it."""
        self.path.rename(under)
        self.path = under

    def unlink(self) -> None:
        """Takes the name away, if it is still this one's."""
        with deciding():
            if self.is_published:
                self.path.unlink()


def create(path: Path, size: int, mode: int) -> Segment:
    """A segment of zeros under a name nobody looks for; `publish` gives it the right one."""
    draft = path.with_name(f".{path.name}-{os.getpid()}-{os.urandom(4).hex()}")
    descriptor = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        os.posix_fallocate(descriptor, 0, size)  # what is not there would be a SIGBUS in a cycle
        os.fchmod(descriptor, mode)
    except OSError as error:
        os.close(descriptor)
        draft.unlink()
        if error.errno != errno.ENOSPC:
            raise
        raise ShareError(
            f"{FOLDER} has no room for {size / 2**20:.1f} MiB",
            hint="less history=, or `mount -o remount,size=...`; in a container --shm-size",
        ) from error
    return Segment(draft, descriptor, writable=True)


def open_segment(path: Path, *, writable: bool = False) -> Segment:
    """One that is there. FileNotFoundError, PermissionError; ShareError: no file, or empty."""
    access = os.O_RDWR if writable else os.O_RDONLY
    try:
        descriptor = os.open(path, access | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except (FileNotFoundError, PermissionError):
        raise
    except OSError as error:
        raise ShareError(f"{path} is no share: {error.strerror}") from error
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode) or status.st_size == 0:
        os.close(descriptor)
        raise ShareError(f"{path} is {'empty' if status.st_size == 0 else 'no file'}")
    return Segment(path, descriptor, writable=writable)
