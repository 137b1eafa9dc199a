"""Order of presses and ends of jogs, without a loop."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

from catenary.dashboard.messages import Press
from catenary.dashboard.motion import Motion
from catenary.share import JogStatus


class Jog:
    """Jog whose status the test sets."""

    def __init__(self) -> None:
        self.status = JogStatus.MOVING
        self.released = False

    def release(self) -> None:
        self.released = True


class Reader:
    """Reader whose leases and jogs are known to the test. `gate` delays each lease."""

    def __init__(self) -> None:
        self.layout = SimpleNamespace(axes=("1 Servo", "2 Servo"))
        self.jogs: list[Jog] = []
        self.leases = 0
        self.entered, self.gate = threading.Event(), threading.Event()
        self.gate.set()

    def lease(self, axes: list[int], *, for_: float) -> Reader:
        self.entered.set()
        assert self.gate.wait(10)
        self.leases += 1
        return self

    def release(self) -> None:
        self.leases -= 1

    def jog(self, *_: object, **__: object) -> Jog:
        self.jogs.append(Jog())
        return self.jogs[-1]


def press(motion: Motion, reader: Any, number: int) -> None:
    motion.press(reader, Press(axis=0, velocity=0.1, token="1", press=number))


def test_the_end_of_a_jog_does_not_release_the_next_jog_of_the_axis() -> None:
    motion, reader = Motion(), Reader()
    press(motion, reader, 1)
    reader.jogs[0].status = JogStatus.DONE
    [change] = motion.changes()
    press(motion, reader, 2)  # was queued before the end of the first jog
    motion.end(change)
    assert not reader.jogs[1].released
    assert reader.leases == 1


def test_an_ended_jog_frees_its_lease() -> None:
    motion, reader = Motion(), Reader()
    press(motion, reader, 1)
    reader.jogs[0].status = JogStatus.RELEASED
    motion.end(motion.changes()[0])
    assert reader.leases == 0


def test_a_press_that_waits_for_the_desk_ends_with_its_client() -> None:
    motion, reader = Motion(), Reader()
    reader.gate.clear()
    pressing = threading.Thread(target=press, args=(motion, reader, 1))
    pressing.start()
    assert reader.entered.wait(10)
    ending = threading.Thread(target=motion.end_all)
    ending.start()
    reader.gate.set()
    pressing.join(10)
    ending.join(10)
    assert [jog.released for jog in reader.jogs] == [True]
    assert reader.leases == 0


def test_a_press_after_the_end_of_its_client_has_no_effect() -> None:
    motion, reader = Motion(), Reader()
    motion.end_all()
    press(motion, reader, 1)
    assert not reader.jogs
