"""Virtual servos as the tests see them: their own state, without the loop, the share or the page.

The process that contains the segment answers each line on its standard input with one line of JSON.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from catenary.virtual import Coupler, Segment, Servo

COUNTS_PER_TURN = 2**20
QUICK_STOP_BIT = 1 << 2  # of the controlword: 0 requests a quick stop
WATCH_SECONDS = 2e-4

Answer = Callable[[list[str]], Any]


def make_segment(names: list[str], *, ring: bool = False) -> Segment:
    """Make a segment with a coupler and one servo for each name, on the clock of the machine."""
    servos = [Servo(name=name, counts_per_turn=COUNTS_PER_TURN) for name in names]
    return Segment([Coupler(), *servos], clock="monotonic", ring=ring)


class Monitor:
    """Answers about the servos of a segment."""

    def __init__(self, segment: Segment) -> None:
        self._segment = segment
        self._servos = [device for device in segment if isinstance(device, Servo)]
        self.answers: dict[str, Answer] = {
            "state": lambda _: self.state(),
            "stop_time": lambda _: self.stop_time(),
            "fault": lambda words: self._servos[int(words[0])].inject_fault(int(words[1], 16)),
            "plug": lambda words: self._segment.plug(int(words[0])),
        }

    def state(self) -> list[dict[str, object]]:
        return [
            {
                "time": time.monotonic(),
                "position": servo.position_rad,
                "velocity": servo.velocity_rad_s,
                "state": servo.drive_state(),
                "controlword": servo.received().controlword,
            }
            for servo in self._servos
        ]

    def stop_time(self) -> float:
        """Wait until the controlword of the first servo requests a quick stop [s, monotonic]."""
        servo = self._servos[0]
        while servo.received().controlword & QUICK_STOP_BIT:
            time.sleep(WATCH_SECONDS)
        return time.monotonic()

    def start(self) -> None:
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        for line in sys.stdin:
            name, *words = line.split()
            answer_line(self.answers[name](words))


def answer_line(value: object) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()
