"""Recorder, which writes the cycles of a share into a file.

It attaches to the share like any other reader, so it cannot delay the loop. It counts the cycles
that it misses. The file contains an event for each gap, and the total number of missed cycles.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import numpy as np

from catenary.errors import RecordingError
from catenary.record.cdr import Rows
from catenary.record.file import RecordingFile
from catenary.record.layout import NUMBER, TIME, Field, Layout
from catenary.record.repair import repair
from catenary.share import Reader, SharedEvent, ShareLayout, attach

READ_INTERVAL = 0.05  # [s] the cycles of one read are encoded together
READS_PER_HISTORY = 8  # minimum, for a share whose history is shorter than 0.4 s
WRITER_TIMEOUT = 0.25  # [s] without a cycle, before checking whether the writer is alive
ENDINGS = {
    "running": "stopped",
    "ended": "the loop ended",
    "dead": "the process of the loop died",
}

T = TypeVar("T")


class Recorder:
    """Owner of a recording that is being written.

        with record.Recorder("arm", "arm.mcap") as recorder:
            recorder.run(seconds=60.0)

    The recording starts with the oldest cycle in the share. `take` writes the new cycles. `run`
    calls it until the loop ends.

    Args:
        share: name of the share, or a Reader from `cat.attach`.
        path: the file.
        force: replace an existing file.
        stale: accept a share whose process has died.
        uid: user ID of the owner of the share (`cat.attach`).

    Raises:
        ShareError: The share cannot be opened (`cat.attach`).
        RecordingError: The file exists (without `force`), another recorder is writing it, the extra
            is not installed, or the disk is full.
        OSError: The file cannot be created.
    """

    def __init__(
        self,
        share: str | Reader,
        path: str | os.PathLike[str],
        *,
        force: bool = False,
        stale: bool = False,
        uid: int | None = None,
    ) -> None:
        self.path = Path(path)
        self.cycles = 0  # number of cycles written
        self.lost = 0  # number of cycles overwritten in the share before they were read
        self.ended = ""  # reason for the end; empty while the recording is running
        self._share = attach(share, stale=stale, uid=uid) if isinstance(share, str) else share
        self._own = isinstance(share, str)
        self._number = 0  # of the last cycle written
        self._serial = 0  # of the last event written
        self._file: RecordingFile | None = None
        try:
            self._file = RecordingFile(path, describe(self._share.layout), force=force)
            (rows, _), (events, _) = self._share.rows(0), self._share.events()
            self._write(rows, events)  # cycles before the first one do not count as lost
        except BaseException:
            self._release()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __str__(self) -> str:
        layout = self._share.layout
        return f"{layout.name} ({len(layout.axes)} axes at {1.0 / layout.period:.6g} Hz)"

    def take(self) -> int:
        """Write the cycles and events since the last call. Return the number of cycles.

        Raises:
            RecordingError: The disk is full or fails. If possible, the file is repaired, and ends
                with its last complete chunk.
        """
        rows, lost = self._share.rows(self._number)
        events, events_lost = self._share.events(self._serial)
        if lost:
            self.lost += lost
            self._report_lost_cycles(rows)
        if events_lost:
            self._report_lost_events(events_lost, events[0])
        self._write(rows, events)
        return len(rows)

    def run(self, *, seconds: float | None = None, stop: threading.Event | None = None) -> None:
        """Record until the loop ends, `seconds` [s] have passed, or `stop` is set.

        Args:
            seconds: maximum duration [s]; None sets no limit.
            stop: event that another thread or a signal handler sets to end the recording. `run`
                sets it when `seconds` have passed.

        Raises:
            RecordingError: The disk is full or fails, as for `take`.
        """
        stop = stop or threading.Event()
        alarm = threading.Timer(seconds or 0.0, stop.set)
        alarm.daemon = True
        if seconds is not None:
            alarm.start()
        try:
            while not stop.is_set():
                if self._share.wait(WRITER_TIMEOUT):
                    self.take()
                    stop.wait(self._read_interval)
                elif not self._share.alive:
                    break
        finally:
            alarm.cancel()

    def close(self) -> None:
        """Write the remaining cycles, finish the file, and close the share that `__init__` opened.

        A no-op if the recorder is closed.

        Raises:
            RecordingError: The disk is full or fails, as for `take`.
        """
        if self._file is None:
            return
        try:
            # Read the state before the last cycles, because an ended loop writes no more cycles.
            state = self._share.state
            self.take()
            self.ended = ENDINGS[state]
            end = {"ended": self.ended, "cycles": self.cycles, "lost": self.lost}
            self._on_disk(RecordingFile.finish, end)
        finally:
            self._release()

    @property
    def _read_interval(self) -> float:
        layout = self._share.layout
        return min(READ_INTERVAL, layout.rows.count * layout.period / READS_PER_HISTORY)

    def _write(self, rows: Rows, events: Sequence[SharedEvent]) -> None:
        for event in events:
            self._serial = event.serial
            self._on_disk(RecordingFile.write_event, event)
        if len(rows):
            self._number = int(rows[NUMBER][-1])
            self._on_disk(RecordingFile.write, rows)
            self.cycles += len(rows)

    def _report_lost_cycles(self, rows: Rows) -> None:
        """Write an event for each gap before the rows or between them."""
        numbers = rows[NUMBER].astype(np.int64)
        missing = np.diff(numbers, prepend=self._number) - 1
        for row in np.flatnonzero(missing).tolist():
            time = float(rows[TIME][row]) * 1e-9 - self._share.layout.period
            number, lost = int(numbers[row]) - 1, int(missing[row])
            self._report(number, "CyclesLost", f"{lost} cycles", time, {"cycles": lost})

    def _report_lost_events(self, lost: int, first: SharedEvent) -> None:
        what = f"{lost} events before this one"
        self._report(first.number, "EventsLost", what, first.time, {"events": lost})

    def _report(
        self, number: int, kind: str, what: str, time: float, details: Mapping[str, object]
    ) -> None:
        message = f"{what} were overwritten before they could be recorded"
        event = SharedEvent(0, number, kind, message, time, None, details)
        self._on_disk(RecordingFile.write_event, event)

    def _on_disk(self, write: Callable[[RecordingFile, T], None], value: T) -> None:
        """Run a write. If it fails, close and repair the file, and raise RecordingError."""
        assert self._file is not None, "the recorder is closed"
        try:
            write(self._file, value)
        except OSError as error:
            self._release()
            raise self._repaired(error) from error

    def _repaired(self, error: OSError) -> RecordingError:
        """Repair the file after a failed write. Return the error to raise."""
        reason = error.strerror or str(error)
        failed = f"cannot write {self.path}: {reason}"
        try:
            repaired = repair(self.path, end={"ended": reason, "lost": self.lost})
        except OSError as second:
            return RecordingError(
                f"{failed}; the index at the end could not be written either ({second.strerror})",
                hint=f"free disk space, then run: catenary record --repair {self.path}",
            )
        if not repaired.chunks:
            return RecordingError(f"{failed}; nothing was recorded", hint="free disk space first")
        return RecordingError(
            f"{failed}; the recording is readable, but ends after {repaired.seconds:.3f} s",
            hint="free disk space before the next recording",
        )

    def _release(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._own:
            self._share.close()


def describe(layout: ShareLayout) -> Layout:
    """Return the layout of a recording of this share."""
    fields = tuple(
        Field(each.name, each.dtype, each.shape, each.unit, each.per_axis) for each in layout.fields
    )
    return Layout(
        layout.name, layout.period, layout.axes, fields, layout.clock, layout.utc_offset_ns
    )
