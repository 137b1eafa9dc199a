"""Recorder: write every cycle of a share into a file.

It attaches like any other reader, so it cannot delay the loop. Cycles that it misses are counted;
the file has events for these gaps and their total number.
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

PACE = 0.05  # [s] between two reads; the cycles of one read are encoded together
LOOKS_PER_HISTORY = 8  # minimum reads per history, for a share that keeps less than 0.5 s
PATIENCE = 0.25  # [s] without a cycle, before checking whether the writer is alive
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

    It begins with the oldest cycle that the share keeps. `take` writes the new cycles; `run` does
    so until the loop ends. `share`: a name, or a Reader of `cat.attach`; `stale`: accept a share
    whose process has died; `uid`: user of the share (`cat.attach`). Raises RecordingError if the
    file exists (without `force`) or the extra is not installed, OSError if the file cannot be
    created.
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
        self.cycles = 0  # written
        self.lost = 0  # overwritten before they were taken
        self.ended = ""  # reason of the end, once it has ended
        self._share = attach(share, stale=stale, uid=uid) if isinstance(share, str) else share
        self._own = isinstance(share, str)
        self._number = 0  # of the last cycle taken
        self._serial = 0  # of the last event taken
        self._file: RecordingFile | None = None
        try:
            self._file = RecordingFile(path, describe(self._share.layout), force=force)
            (rows, _), (events, _) = self._share.rows(0), self._share.events()
            self._write(rows, events)  # older cycles do not count as lost
        except BaseException:
            self._let_go()
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
        """Write every cycle and event since the last call. Return the number of cycles.

        Raises RecordingError if the disk is full or fails; the file is repaired up to that point.
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
        """Record until the loop ends, for `seconds` [s], or until `stop` is set.

        Args:
            seconds: maximum duration; None: no limit.
            stop: event that ends the recording.
        """
        stop = stop or threading.Event()
        alarm = threading.Timer(seconds or 0.0, stop.set)
        alarm.daemon = True
        if seconds is not None:
            alarm.start()
        try:
            while not stop.is_set():
                if self._share.wait(PATIENCE):
                    self.take()
                    stop.wait(self._pace)
                elif not self._share.alive:
                    break
        finally:
            alarm.cancel()

    def close(self) -> None:
        """Write the remaining cycles and finish the file. Raises RecordingError as `take` does."""
        if self._file is None:
            return
        try:
            state = self._share.state  # read first: after an end no more cycles can follow
            self.take()
            self.ended = ENDINGS[state]
            words = {"ended": self.ended, "cycles": self.cycles, "lost": self.lost}
            self._on_disk(RecordingFile.finish, words)
        finally:
            self._let_go()

    @property
    def _pace(self) -> float:
        layout = self._share.layout
        return min(PACE, layout.rows.count * layout.period / LOOKS_PER_HISTORY)

    def _write(self, rows: Rows, events: Sequence[SharedEvent]) -> None:
        for event in events:
            self._serial = event.serial
            self._on_disk(RecordingFile.write_event, event)
        if len(rows):
            self._number = int(rows[NUMBER][-1])
            self._on_disk(RecordingFile.write, rows)
            self.cycles += len(rows)

    def _report_lost_cycles(self, rows: Rows) -> None:
        """Write an event for each gap before or within the rows."""
        numbers = rows[NUMBER].astype(np.int64)
        missing = np.diff(numbers, prepend=self._number) - 1
        for row in np.flatnonzero(missing).tolist():
            time = float(rows[TIME][row]) * 1e-9 - self._share.layout.period
            number, lost = int(numbers[row]) - 1, int(missing[row])
            self._report(number, "CyclesLost", f"{lost} cycles", time, {"cycles": lost})

    def _report_lost_events(self, lost: int, first: SharedEvent) -> None:
        what = f"{lost} events before this"
        self._report(first.number, "EventsLost", what, first.time, {"events": lost})

    def _report(
        self, number: int, kind: str, what: str, time: float, details: Mapping[str, object]
    ) -> None:
        message = f"{what} were overwritten before they could be recorded"
        event = SharedEvent(0, number, kind, message, time, None, details)
        self._on_disk(RecordingFile.write_event, event)

    def _on_disk(self, write: Callable[[RecordingFile, T], None], value: T) -> None:
        """Run a write that may fail on a full disk."""
        assert self._file is not None, "the recorder is closed"
        try:
            write(self._file, value)
        except OSError as error:
            self._let_go()
            raise self._cut_off(error) from error

    def _cut_off(self, error: OSError) -> RecordingError:
        reason = error.strerror or str(error)
        failed = f"{self.path}: {reason}"
        try:
            repaired = repair(self.path, end={"ended": reason, "lost": self.lost})
        except OSError as second:
            return RecordingError(
                f"{failed}; not even its end could be written ({second.strerror})",
                hint=f"make room, then: catenary record --repair {self.path}",
            )
        if not repaired.chunks:
            return RecordingError(f"{failed}; nothing was recorded", hint="make room first")
        return RecordingError(
            f"{failed}; the recording is whole, but ends after {repaired.seconds:.3f} s",
            hint="make room before the next one",
        )

    def _let_go(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._own:
            self._share.close()


def describe(layout: ShareLayout) -> Layout:
    """Return the recording's layout of a share."""
    fields = tuple(
        Field(each.name, each.dtype, each.shape, each.unit, each.per_axis) for each in layout.fields
    )
    return Layout(
        layout.name, layout.period, layout.axes, fields, layout.clock, layout.utc_offset_ns
    )
