"""Root file system as a cpio archive, format "newc".

The format is in Documentation/driver-api/early-userspace/buffer-format.rst of the kernel. Writing
it needs no root permission, no mount and no other program.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

MAGIC = b"070701"
TRAILER = "TRAILER!!!"
COPY_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of the archive. The content of a regular file is read from `source` on writing."""

    path: str  # absolute
    mode: int
    mtime: int = 0  # [s]; Python checks its compiled files by it
    data: bytes = b""  # content of a link or a small file
    source: Path | None = None
    device: tuple[int, int] = (0, 0)


def folder(path: str) -> Entry:
    return Entry(path, stat.S_IFDIR | 0o755)


def text(path: str, content: str, *, mode: int = 0o644) -> Entry:
    return Entry(path, stat.S_IFREG | mode, data=content.encode())


def link(path: str, target: str) -> Entry:
    return Entry(path, stat.S_IFLNK | 0o777, data=target.encode())


def character_device(path: str, major: int, minor: int) -> Entry:
    return Entry(path, stat.S_IFCHR | 0o600, device=(major, minor))


def copy_of(source: Path, path: str = "") -> Entry:
    """Return an entry for a file, under its own path or another. Links are followed.

    Args:
        source: File to copy.
        path: Path in the archive; None for that of `source`.

    Raises:
        OSError: The file cannot be read.
    """
    status = source.stat()
    mode = stat.S_IFREG | (0o755 if status.st_mode & 0o100 else 0o644)
    return Entry(path or str(source), mode, int(status.st_mtime), source=source.resolve())


def write(entries: Iterable[Entry], file: BinaryIO) -> None:
    """Write all entries, with their folders.

    Args:
        entries: Entries to write.
        file: Archive.

    Raises:
        OSError: The disk is full, or a source cannot be read.
    """
    for number, entry in enumerate(with_folders(entries), start=1):
        size = len(entry.data) if entry.source is None else entry.source.stat().st_size
        file.write(_header(entry, size, number))
        file.write(entry.data if entry.source is None else b"")
        if entry.source is not None:
            _copy(entry.source, size, file)
        file.write(bytes(-size % 4))
    file.write(_header(Entry(TRAILER, 0), 0, 0))


def with_folders(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Yield each path once, after its parent folders."""
    known = {"/"}
    for entry in entries:
        for parent in reversed(Path(entry.path).parents):
            if str(parent) not in known:
                known.add(str(parent))
                yield folder(str(parent))
        if entry.path not in known:
            known.add(entry.path)
            yield entry


def _header(entry: Entry, size: int, number: int) -> bytes:
    name = entry.path.lstrip("/").encode() + b"\0"
    links = 2 if stat.S_ISDIR(entry.mode) else 1
    # inode, mode, uid, gid, links, mtime, size, device of the file system, device, name, checksum
    numbers = (number, entry.mode, 0, 0, links, entry.mtime, size, 0, 0, *entry.device)
    fields = b"".join(b"%08x" % value for value in (*numbers, len(name), 0))
    head = MAGIC + fields + name
    return head + bytes(-len(head) % 4)


def _copy(source: Path, size: int, file: BinaryIO) -> None:
    """Copy exactly `size` bytes, even if the source changes during the copy."""
    with source.open("rb") as data:
        left = size
        while left:
            block = data.read(min(left, COPY_BYTES)) or bytes(min(left, COPY_BYTES))
            file.write(block)
            left -= len(block)


def fingerprint_of(entry: Entry) -> str:
    """Return a text that changes with the entry, without reading a large file."""
    if entry.source is None:
        return f"{entry.path} {entry.mode} {entry.data!r} {entry.device}"
    status = os.stat(entry.source)
    return f"{entry.path} {entry.mode} {status.st_size} {status.st_mtime_ns}"
