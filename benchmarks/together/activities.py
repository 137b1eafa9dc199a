"""Activities next to the loop: objects, files, Ethernet frames and cuts of the ring."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from random import Random

import catenary as cat
from benchmarks.together.cell import DRIVES, ETHERNET, FILES
from benchmarks.together.ping import PingInterface
from catenary.bus.ethernet_bridge import EthernetBridge
from catenary.bus.pending import Pending
from catenary.errors import CatenaryError
from catenary.types import UDINT
from catenary.virtual import Segment
from catenary.virtual import faults as f

OBJECT_EVERY = 50  # cycles
WAITING_MAX = 20  # objects that wait; further ones are not requested
IDENTITY, PRODUCT = 0x1018, 2
FILE, FILE_BYTES = "program.bin", 16 * 1024
CUT_EVERY, CUT_SECONDS = 20.0, 1.0  # [s] of the loop's time
DEVICES = 5  # of the ring
FAILURES_SHOWN = 5


class Done:
    """Counts of successes, and the texts of the first failures. Any thread may add to it."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.failures: list[str] = []
        self._lock = threading.Lock()

    def add(self, what: str, number: int = 1) -> None:
        with self._lock:
            self.counts[what] += number

    def fail(self, what: str, reason: object) -> None:
        with self._lock:
            self.counts[f"{what} failed"] += 1
            if len(self.failures) < FAILURES_SHOWN:
                self.failures.append(f"{what}: {' '.join(str(reason).split())}")


class Objects:
    """Owner of the objects that were requested, and not answered yet."""

    def __init__(self, main: cat.MainDevice, done: Done) -> None:
        self._subs = [main.subs[position] for position in DRIVES]
        self._done = done
        self._waiting: list[tuple[int, Pending[int]]] = []

    def step(self, cycle: int) -> None:
        """Request an object, and check the answers. Call it in each cycle."""
        if cycle % OBJECT_EVERY == 0 and len(self._waiting) < WAITING_MAX:
            sub = self._subs[cycle // OBJECT_EVERY % len(self._subs)]
            answer = sub.sdo.request(IDENTITY, PRODUCT, type=UDINT)
            self._waiting.append((sub.identity.product, answer))
        for entry in [each for each in self._waiting if each[1].done]:
            self._waiting.remove(entry)
            expected, answer = entry
            if answer.error is not None:
                self._done.fail("objects", answer.error)
            elif answer.result() != expected:
                self._done.fail("objects", f"{answer.result():#x} instead of {expected:#x}")
            else:
                self._done.add("objects")


class Cuts:
    """Cuts of the ring at random places. A cut ends before the next one begins."""

    def __init__(self, segment: Segment | None, done: Done, seed: int) -> None:
        self._segment = segment
        self._random = Random(seed)
        self._next = CUT_EVERY / 2
        self._done = done

    def step(self, time: float) -> None:
        """Cut the ring if it is time. Call it in each cycle."""
        if self._segment is None or time < self._next:
            return
        self._next = time + CUT_EVERY
        place = self._random.randrange(DEVICES - 1)
        self._segment.inject(f.cut(between=(place, place + 1), for_=CUT_SECONDS))
        self._done.add("cuts")


class Files:
    """Owner of a thread that writes and reads a file of a device, again and again."""

    def __init__(self, main: cat.MainDevice, done: Done) -> None:
        self._foe, self._done = main.subs[FILES].foe, done
        self._data = bytes(k * 7 + k // 251 & 0xFF for k in range(FILE_BYTES))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="soak files", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End after the present transfer, for which the loop must continue."""
        self._stop.set()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._foe.write(FILE, self._data)
                if self._foe.read(FILE) != self._data:
                    raise ValueError(f"{FILE} is not what was written")
                self._done.add("file bytes", 2 * len(self._data))
            except (CatenaryError, ValueError, RuntimeError) as error:
                self._done.fail("files", error)
                self._stop.wait(1.0)


@contextmanager
def ethernet(main: cat.MainDevice, done: Done) -> Iterator[PingInterface]:
    """Ping the Ethernet port of a device, and yield the counts."""
    pings = PingInterface()

    def report(_: object, __: object, error: CatenaryError | None) -> None:
        if error is not None:
            done.fail("Ethernet", error)

    bridge = EthernetBridge(main, [main.subs[ETHERNET]], pings, report=report)
    try:
        yield pings
    finally:
        bridge.close()
        done.add("pings", pings.answers)
        if pings.wrong:
            done.fail("Ethernet", f"{pings.wrong} wrong answers")
