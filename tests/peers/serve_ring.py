"""A served ring with signals: SIGUSR1 cuts a cable, SIGUSR2 joins it.

serve_ring.py FILE.toml NIC NIC2 DEVICE DEVICE
"""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType

from catenary.virtual import Server, read_segment
from catenary.virtual.faults import cut, join


def main(path: str, first: str, second: str, one: str, other: str) -> None:
    segment = read_segment(path, clock="monotonic", ring=True)
    between = int(one), int(other)
    asked_to_end = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        asked_to_end.set()

    def cut_it(_signal: int, _frame: FrameType | None) -> None:
        segment.inject(cut(between=between))

    def join_it(_signal: int, _frame: FrameType | None) -> None:
        segment.inject(join(between=between))

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGUSR1, cut_it)
    signal.signal(signal.SIGUSR2, join_it)
    with Server(segment, first, second=second, max_age=None):
        print("ready", flush=True)
        said = 0
        while not asked_to_end.wait(0.02):
            for event in segment.fault_log[said:]:
                print(event.fault.kind, flush=True)
            said = len(segment.fault_log)


if __name__ == "__main__":
    main(*sys.argv[1:])
