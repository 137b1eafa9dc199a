"""Captures of a network: the last frames in memory, and a file around an error or a stopped axis.

The cycle only copies frames (link/frame_memory.py). A thread frees old frames, and writes the file
of a stopped axis after `CaptureOptions.after`. The end of the loop writes the other files. In
virtual time, the end of the loop writes all files.
"""

from __future__ import annotations

import itertools
import os
import re
import threading
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from catenary.bus import MainDevice
from catenary.bus.event_types import AxisStopped, Event
from catenary.bus.thread_priority import step_behind
from catenary.link.frame_memory import FrameMemory
from catenary.loop.capture_options import CaptureOptions

END_TIMEOUT = 30.0  # [s] for a file that is being written; a disk may be slow
TRIM = 0.25  # [s] between two calls of `FrameMemory.trim`
DRAIN_NS = 50_000_000  # time until a frame is in the memory: the thread of the Recorder takes 10 ms
MARKS = 100  # stopped axes that wait for their file


class Mark(NamedTuple):
    """A time around which frames are kept."""

    time_ns: int  # on the clock of the link
    reason: str


class FrameCapture:
    """Owner of the frame memory of one network, from its bring-up until the devices have left OP.

    Raises:
        ConfigurationError: The folder cannot be made or written.
        OSError: The memory cannot be allocated.
    """

    def __init__(self, options: CaptureOptions, main: MainDevice) -> None:
        self.files: list[Path] = []
        self._options = options
        self._folder = options.make_folder()
        self._main = main
        self._link = main.link
        self._memory = FrameMemory(main.link, options.memory)
        self._marks: deque[Mark] = deque(maxlen=MARKS)
        self._error: BaseException | None = None
        self._ended = threading.Event()
        self._is_over = False
        self._process = os.getpid()
        self._unsubscribe = main.events.listen(self._on_event)
        self._thread = threading.Thread(target=self._serve, name="catenary capture", daemon=True)
        try:
            self._thread.start()
            main.replace_link(self._memory.link)
        except BaseException:
            self.end()
            raise

    def fail(self, error: BaseException) -> None:
        """Keep the frames around the error that ends the loop. Its notes will name the file.

        The first error counts. Ctrl-C and the end of the program are not errors. After `end`, a
        call has no effect.
        """
        if not self._is_over and self._error is None and isinstance(error, Exception):
            self._error = error
            self._marks.append(Mark(self._memory.link.now(), type(error).__name__))

    def end(self) -> None:
        """End the recording, write the pending file, and free the memory.

        A second call has no effect. In a forked child, a call has no effect, either.
        """
        if self._is_over or self._process != os.getpid():
            return
        self._is_over = True
        self._unsubscribe()
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join(END_TIMEOUT)
        is_writing = self._thread.is_alive()  # it still uses the memory
        to_ns = max([self._memory.link.now(), *(mark.time_ns for mark in list(self._marks))])
        try:
            self._return_link()
            if is_writing:
                self._report(f"a capture in {self._folder} is not complete after {END_TIMEOUT:g} s")
            elif self._marks:
                self._write(to_ns)
        finally:
            if not is_writing:
                self._memory.release()
            self._error = None  # its traceback refers to the program

    def _return_link(self) -> None:
        """Use the link without the recorder again, and end the recording."""
        try:
            if self._main.is_open and self._main.link is self._memory.link:
                self._main.replace_link(self._link)
        finally:
            self._memory.close()

    def _on_event(self, event: Event) -> None:
        if isinstance(event, AxisStopped):
            self._marks.append(Mark(round(event.time * 1e9), f"axis {event.axis} stopped"))

    def _serve(self) -> None:
        step_behind()
        while not self._ended.wait(TRIM):
            self._memory.trim()
            if (to_ns := self._due()) is not None:
                self._write(to_ns)

    def _due(self) -> int | None:
        """Return the end of the pending file [ns]; None if its frames are not in the memory yet.

        Axes may stop again and again. A file then ends before the memory frees its first frames.
        """
        if not self._marks or self._error is not None or self._memory.is_virtual:
            return None
        first_ns, last_ns = self._marks[0].time_ns, self._marks[-1].time_ns
        to_ns = min(last_ns, first_ns + nanoseconds(self._options.before))
        to_ns += nanoseconds(self._options.after)
        return to_ns if self._memory.link.now() >= to_ns + DRAIN_NS else None

    def _write(self, to_ns: int) -> None:
        """Write one file for all marks until a time, and report its name or a failure.

        Args:
            to_ns: Time of the last frame [ns].
        """
        marks = [self._marks.popleft()]
        while self._marks and self._marks[0].time_ns <= to_ns:
            marks.append(self._marks.popleft())
        first = marks[0]
        from_ns = first.time_ns - nanoseconds(self._options.before)
        reason = marks[-1].reason if self._error is not None else first.reason
        if len(self.files) >= self._options.files:
            self._report(f"no capture of the frames: CaptureOptions.files={self._options.files}")
            return
        try:
            path = free_path(self._folder, self._link.name, reason)
            held_ns, _ = self._memory.write(path, from_ns, to_ns)
        except OSError as error:
            self._report(f"no capture of the frames in {self._folder}: {error.strerror}")
            return
        self.files.append(path)
        before = (first.time_ns - held_ns) * 1e-9
        side = "before" if before >= 0.0 else "after"  # older frames were freed
        self._report(f"frames from {abs(before):.3f} s {side}: {path}", reason)

    def _report(self, text: str, reason: str = "") -> None:
        """Add a note to the error of the loop. Without an error, write to the log."""
        if self._error is not None:
            self._error.add_note(text)
        else:
            import logging  # registers a fork hook in Python, in which a signal is lost

            logging.getLogger("catenary").warning("%s", f"{reason}: {text}" if reason else text)


def nanoseconds(seconds: float) -> int:
    """Return a time in ns."""
    return round(seconds * 1e9)


def free_path(folder: Path, name: str, reason: str) -> Path:
    """Return a path that no file has: FOLDER/NAME-TIME-REASON.pcapng.

    Args:
        folder: Folder of the captures.
        name: Name of the link.
        reason: Reason of the capture.
    """
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    start = re.sub(r"[^\w.]+", "-", f"{name}-{stamp}-{reason}", flags=re.ASCII)[:150]
    names = itertools.chain([start], (f"{start}-{number}" for number in itertools.count(2)))
    paths = (folder / f"{each}.pcapng" for each in names)
    return next(path for path in paths if not path.exists())
