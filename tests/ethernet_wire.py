"""Wire: an end of a bridge that takes the place of a TAP interface."""

from __future__ import annotations

import queue
import threading

SECONDS = 60.0  # generous: no test measures a time


class Wire:
    """Takes the place of a TAP interface."""

    name = "wire"

    def __init__(self) -> None:
        self.to_devices: queue.Queue[bytes] = queue.Queue()
        self.from_devices: queue.Queue[bytes] = queue.Queue()
        self.closed = False
        self.up = True
        self._woken = threading.Event()

    def wait(self, seconds: float | None = None) -> bool:
        self._woken.wait(0.01)
        return not self.to_devices.empty()

    def wake(self) -> None:
        self._woken.set()

    def read(self) -> bytes | None:
        try:
            return self.to_devices.get_nowait()
        except queue.Empty:
            return None

    def write(self, frame: bytes) -> bool:
        if self.up:
            self.from_devices.put(frame)
        return self.up

    def close(self) -> None:
        self.closed = True

    def next(self) -> bytes:
        return self.from_devices.get(timeout=SECONDS)
