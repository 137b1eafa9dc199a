"""Memory of the last frames of a link, from which a capture of any of its times can be written.

Theory of operation. A `Recorder` writes its pcapng file into a file in memory, memfd_create(2). The
cycle only copies each frame into the ring of the Recorder. The thread of the Recorder copies the
ring into the file. `trim` frees the oldest pages, fallocate(2), so that the size is bounded. The
pages are allocated at the start. To write a capture, the first block of the requested time is found
by bisection, and large parts of the file are copied without the GIL.
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct
import time
from pathlib import Path
from typing import BinaryIO

from catenary.link._recorder import Recorder
from catenary.link._table import capsule_in_virtual_time
from catenary.link.borrowed import BorrowedLink
from catenary.link.protocol import Link
from catenary.wire.pcapng import encode_header, encode_statistics

FALLOC_FL_KEEP_SIZE, FALLOC_FL_PUNCH_HOLE = 1, 2  # linux/falloc.h
PAGE = 4096
MEMORY, AVAILABLE = Path("/proc/meminfo"), "MemAvailable:"  # proc(5)
STATISTICS_BLOCK, PACKET_BLOCK = 5, 6  # of a Recorder
MAXIMUM_BLOCK = 1600  # [bytes]
WINDOW = 4 * MAXIMUM_BLOCK  # bytes in which all blocks must be valid
COPY_SIZE = 1 << 20


class FrameMemory:
    """Owner of a Recorder and of the memory that it fills.

    Send and receive through `link`. After `close`, the frames can still be written.

    Raises:
        OSError: The memory cannot be allocated, or the thread of the Recorder cannot be started.
    """

    def __init__(self, link: Link, size: int) -> None:
        """Allocate `size` bytes, and record the frames of `link`, which stays open."""
        require_memory(size)
        self._size = size
        self._punched = 0  # freed bytes at the start of the file
        self._header = encode_header(link.name)
        self._file = os.memfd_create("catenary frames", os.MFD_CLOEXEC)
        try:
            self.link = Recorder(BorrowedLink(link), f"/proc/self/fd/{self._file}")
            try:
                change_pages(self._file, FALLOC_FL_KEEP_SIZE, 0, size)
            except BaseException:
                self.link.close()
                raise
        except BaseException:
            os.close(self._file)
            raise
        is_virtual = link.capsule is not None and capsule_in_virtual_time(link.capsule)
        self.is_virtual = is_virtual  # True: frames appear in the memory late, at least at `close`
        self.offset_ns = 0 if is_virtual else time.time_ns() - link.now()  # of the time stamps

    def trim(self) -> None:
        """Free the pages of the oldest frames beyond the size. Call it regularly."""
        excess = os.fstat(self._file).st_size - self._size
        end = excess - excess % PAGE
        if end > self._punched:
            flags = FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE
            change_pages(self._file, flags, self._punched, end - self._punched)
            self._punched = end

    def close(self) -> None:
        """End the recording. The link is not used any more, and the frames are kept."""
        self.link.close()

    def release(self) -> None:
        """Free the memory. A second call has no effect."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    def write(self, path: Path, from_ns: int, to_ns: int) -> tuple[int, int]:
        """Write the frames of a time into a new pcapng file. An error leaves no file.

        Args:
            path: Path of the file.
            from_ns: First time, on the clock of the link [ns].
            to_ns: Last time [ns].

        Returns:
            Times of the first frame and of the end of the frames [ns]; equal without frames.

        Raises:
            OSError: The file exists or cannot be written.
        """
        end = self._end()
        first = self._find(from_ns, end)
        last = self._find(to_ns + 1, end)
        dropped = self.link.dropped
        statistics = encode_statistics(
            to_ns + self.offset_ns, received=self.link.recorded + dropped, dropped=dropped
        )
        file = path.open("xb")
        try:
            with file:
                file.write(self._header)
                copy_bytes(self._file, file, first, last - first)
                file.write(statistics)
        except BaseException:  # such as a full disk
            path.unlink(missing_ok=True)
            raise
        found = self._block_from(first, end) if first < last else None
        return (to_ns, to_ns) if found is None else (found[1] - self.offset_ns, to_ns)

    def _end(self) -> int:
        """Return the end of the last complete packet block."""
        size = os.fstat(self._file).st_size
        start = max(self._punched, len(self._header), (size - WINDOW) & ~3)
        found = self._block_from(start, size)
        if found is None:
            return start
        at = found[0]
        data = os.pread(self._file, size - at, at)
        while (length := packet_length(data, at - found[0])) is not None:
            at += length
        return at

    def _find(self, time_ns: int, end: int) -> int:
        """Return the offset of the first block that is not older than a time; `end` if none.

        Args:
            time_ns: Time on the clock of the link [ns].
            end: Size of the file.
        """
        wanted = time_ns + self.offset_ns
        low, high = max(self._punched, len(self._header)), end
        while low < high:  # all blocks that begin before `low` are older
            middle = (low + high) // 2 & ~3
            found = self._block_from(middle, end)
            if found is not None and found[1] < wanted:
                low = found[0] + 4
            else:
                high = middle
        found = self._block_from(low, end)
        return end if found is None else found[0]

    def _block_from(self, offset: int, end: int) -> tuple[int, int] | None:
        """Return the offset and the time of the first block from an offset on; None if none.

        Args:
            offset: Multiple of 4, possibly inside a block.
            end: Size of the file.
        """
        data = os.pread(self._file, min(WINDOW, end - offset), offset)
        for start in range(0, min(len(data), MAXIMUM_BLOCK), 4):
            if are_blocks(data, start):
                high, low = struct.unpack_from("<II", data, start + 12)
                return offset + start, high << 32 | low
        return None


def are_blocks(data: bytes, start: int) -> bool:
    """Return True if at least one packet block begins at `start`, and only blocks follow.

    Args:
        data: Part of a file.
        start: Offset in `data`.
    """
    at = start
    while at + 8 <= len(data):
        kind, length = struct.unpack_from("<II", data, at)
        if length % 4 or not 12 <= length <= MAXIMUM_BLOCK:
            return False
        if kind != PACKET_BLOCK:  # statistics are the last block of a file
            return kind == STATISTICS_BLOCK and at > start
        if at + length > len(data):
            break
        if struct.unpack_from("<I", data, at + length - 4)[0] != length:
            return False
        at += length
    return at > start


def packet_length(data: bytes, at: int) -> int | None:
    """Return the length of the packet block at an offset; None if it is another or incomplete.

    Args:
        data: Part of a file.
        at: Offset of a block.
    """
    if at + 8 > len(data):
        return None
    kind, length = struct.unpack_from("<II", data, at)
    return int(length) if kind == PACKET_BLOCK and at + length <= len(data) else None


def copy_bytes(source: int, target: BinaryIO, offset: int, size: int) -> None:
    """Copy a part of a file to the end of another. Other threads continue meanwhile.

    Args:
        source: Descriptor of the source.
        target: File to write.
        offset: First byte.
        size: Number of bytes.
    """
    end = offset + size
    while offset < end:
        data = os.pread(source, min(COPY_SIZE, end - offset), offset)
        target.write(data)
        offset += len(data)


def require_memory(size: int) -> None:
    """Raise OSError if a size exceeds half of the available memory.

    The kernel would end other programs, rather than refuse the allocation.
    """
    lines = MEMORY.read_text().splitlines()
    available = next((int(row.split()[1]) for row in lines if row.startswith(AVAILABLE)), 0) * 1024
    if size > available // 2:
        raise OSError(
            errno.ENOMEM,
            f"{size >> 20} MiB for frames are too much: {available >> 20} MiB are available",
        )


def change_pages(file: int, mode: int, offset: int, size: int) -> None:
    """Allocate or free pages of a file in memory. Raises OSError if the kernel refuses.

    Args:
        file: Descriptor of the file.
        mode: Flags of fallocate(2).
        offset: First byte.
        size: Number of bytes.
    """
    fallocate = ctypes.CDLL(None, use_errno=True).fallocate
    arguments = (ctypes.c_long(offset), ctypes.c_long(size))  # off_t has the size of a long
    if fallocate(ctypes.c_int(file), ctypes.c_int(mode), *arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"cannot allocate the memory for frames: {os.strerror(number)}")
