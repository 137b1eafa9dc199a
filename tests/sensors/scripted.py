"""A source whose connections follow a script, in a time of its own, and a decoder for it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Sequence

from catenary.sensors import Channel, Counters, Sample

MS = 1_000_000


class Script:
    """A source. Each connection is a list of steps: (milliseconds, data) or an exception.

    The event `stop` is set when the last script ends.
    """

    name = "script"

    def __init__(self, *connections: Sequence[tuple[float, bytes] | BaseException]) -> None:
        self.scripts = [list(each) for each in connections]
        self.stop = threading.Event()
        self.now_ns = time.monotonic_ns()
        self.opened = self.closed = 0
        self.written: list[bytes] = []

    def open(self) -> Script:
        self.opened += 1
        if self.scripts and self.scripts[0] and isinstance(self.scripts[0][0], FileNotFoundError):
            raise self.scripts.pop(0)[0]
        return self

    def read(self, timeout: float) -> tuple[bytes, int]:
        script = self.scripts[0]
        step = script.pop(0)
        if not script:
            self.scripts.pop(0)
            if not self.scripts:
                self.stop.set()
        if isinstance(step, BaseException):
            raise step
        self.now_ns += round(step[0] * MS)
        return step[1], self.now_ns

    def write(self, data: bytes) -> None:
        self.written.append(data)

    def close(self) -> None:
        self.closed += 1


class Lines:
    """A decoder of JSON lines: [time in ms or null, value]. Other lines are garbage."""

    rate = 500.0
    channels = (Channel("value", "N"),)

    def __init__(self, clock: str = "device") -> None:
        self.clock = clock
        self.counters = Counters()
        self.starts = 0

    def start(self) -> Sequence[bytes]:
        self.starts += 1
        return (b"start",)

    def stop(self) -> Sequence[bytes]:
        return (b"stop",)

    def feed(self, data: bytes, received_ns: int) -> list[Sample]:
        try:
            at, value = json.loads(data)
        except ValueError:
            self.counters.garbage += len(data)
            return []
        return [Sample(None if at is None else round(at * MS), {"value": value})]


def line(at: float | None, value: float) -> bytes:
    return json.dumps([at, value]).encode()
