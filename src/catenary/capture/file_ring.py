"""Ring of pcapng files: it keeps the newest packets, within a bound of time and a bound of size.

A ring for `line.pcapng` has the files `line-000001.pcapng`, `line-000002.pcapng`, and so on. Each
is a complete capture. The oldest file is deleted when the others contain enough.
"""

from __future__ import annotations

import contextlib
import re
from collections import deque
from collections.abc import Iterable
from io import BufferedWriter, FileIO
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from catenary.errors import RecordingError
from catenary.wire.pcapng import Packet, encode_header, encode_packet, encode_statistics

PARTS = 10  # complete files that together hold the requested time or size
SUFFIX = ".pcapng"
DIGITS = 6  # of the number: names sort for months, and a date of 8 digits is not a number of a ring
MINIMUM_SIZE = 64 * 1024  # [bytes] of a ring


class Part(NamedTuple):
    """A complete file of a ring."""

    path: Path
    size: int
    ended_ns: int  # time of its last packet


class FileRing:
    """Owner of the files of a ring. It writes packets, and deletes the oldest file.

    All files together contain at most `size` bytes. Files are deleted earlier if all their packets
    are older than `duration_ns`.

    Raises:
        RecordingError: Files of an earlier ring exist, and `force` is False.
        ValueError: A bound is too small.
        OSError: A file cannot be written or deleted.
    """

    def __init__(
        self,
        path: Path,
        *,
        interface: str,
        duration_ns: int,
        size: int,
        force: bool = False,
    ) -> None:
        """Delete the files of an earlier ring if `force`, and begin the first file.

        Args:
            path: Name of the ring; the files have numbers after it.
            interface: Name of the interface, for the files.
            duration_ns: Time for which packets are kept [ns].
            size: Maximum size of all files [bytes].
            force: True to replace the files of an earlier ring.
        """
        if duration_ns <= 0 or size < MINIMUM_SIZE:
            raise ValueError(
                f"a ring of {duration_ns} ns and {size} bytes is too small: it needs at least 1 ns "
                f"and {MINIMUM_SIZE} bytes"
            )
        self.packets = 0  # written so far, including those of deleted files
        self._name = path.with_suffix("") if path.suffix == SUFFIX else path
        self._interface = interface
        self._duration_ns = duration_ns
        self._part_ns = max(1, duration_ns // PARTS)
        self._size, self._part_size = size, size // (PARTS + 1)
        self._parts: deque[Part] = deque()
        self._number = self._file_size = self._file_packets = 0
        self._started_ns = self._ended_ns = 0  # times of the first and the last packet of the file
        self.dropped = self._dropped_before = 0  # packets that were not recorded
        delete_earlier(self._name, force)
        self._begin()

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that exist, oldest first."""
        complete = tuple(part.path for part in self._parts)
        return complete if self._file.closed else (*complete, self._path)

    def write(self, packets: Iterable[Packet]) -> None:
        """Append packets, in the order of their times."""
        for packet in packets:
            block = encode_packet(packet)
            if self._is_full(packet.time_ns, len(block)):
                self._end()
                self._begin()
            if not self._file_packets:
                self._started_ns = packet.time_ns
            self._ended_ns = packet.time_ns
            self._file.write(block)
            self._file_size += len(block)
            self._file_packets += 1
            self.packets += 1
            self._delete_old(packet.time_ns)

    def flush(self, dropped: int) -> None:
        """Give the packets to the kernel, so that a killed program does not lose them.

        Args:
            dropped: Number of packets that were not recorded so far, for the statistics.
        """
        self.dropped = dropped
        self._file.flush()

    def close(self) -> None:
        """Complete the last file. A second call has no effect."""
        if not self._file.closed:
            self._end()

    def _is_full(self, time_ns: int, size: int) -> bool:
        if not self._file_packets:
            return False
        is_late = time_ns - self._started_ns >= self._part_ns
        return is_late or self._file_size + size + STATISTICS_SIZE > self._part_size

    def _begin(self) -> None:
        self._number += 1
        self._path = numbered(self._name, self._number)
        self._file = BufferedWriter(FileIO(self._path, "x"))
        self._file_size = self._file.write(encode_header(self._interface))
        self._file_packets = 0

    def _end(self) -> None:
        """Write the statistics of the current file, and close it."""
        dropped = self.dropped - self._dropped_before
        self._dropped_before = self.dropped
        received = self._file_packets + dropped
        end = encode_statistics(self._ended_ns, received=received, dropped=dropped)
        with self._file:
            self._file.write(end)
        self._parts.append(Part(self._path, self._file_size + len(end), self._ended_ns))

    def _delete_old(self, now_ns: int) -> None:
        """Delete the oldest files that exceed the bounds."""
        oldest_ns = now_ns - self._duration_ns
        while self._parts and (
            self._parts[0].ended_ns < oldest_ns
            or sum(part.size for part in self._parts) > self._size - self._part_size
        ):
            self._parts.popleft().path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


STATISTICS_SIZE = len(encode_statistics(0, received=0, dropped=0))


def numbered(name: Path, number: int) -> Path:
    """Return the path of a file of a ring.

    Args:
        name: Path of the ring, without suffix.
        number: Number of the file, from 1.
    """
    return name.with_name(f"{name.name}-{number:0{DIGITS}}{SUFFIX}")


def earlier_files(name: Path) -> list[Path]:
    """Return the existing files of a ring, oldest first."""
    pattern = re.compile(re.escape(name.name) + rf"-(\d{{{DIGITS}}})" + re.escape(SUFFIX))
    found = {
        int(match[1]): each
        for each in name.parent.iterdir()
        if (match := pattern.fullmatch(each.name))
    }
    return [found[number] for number in sorted(found)]


def delete_earlier(name: Path, force: bool) -> None:
    """Delete the files of an earlier ring. Raises RecordingError if there are any, unless `force`.

    Args:
        name: Path of the ring, without suffix.
        force: True to delete the files.
    """
    found = earlier_files(name)
    if found and not force:
        raise RecordingError(
            f"{len(found)} files of an earlier recording exist, from {found[0]} to {found[-1]}",
            hint="use another name (-o FILE), or --force to replace them",
        )
    for each in found:
        with contextlib.suppress(FileNotFoundError):
            each.unlink()
