"""Readers are killed (kill -9) while they read or wait.
The loop and the other readers miss no cycle, and nothing is left behind.
"""

import signal

import numpy as np
import pytest

import catenary as cat
from tests.share.names import own_name
from tests.share.processes import LOOP, comes_true, started

READING = """
import sys
import catenary as cat
arm = cat.attach(sys.argv[1])
arm.wait()
print("reading", flush=True)
while True:
    arm.read()
    arm.rows(after=arm.number - 1000)
"""
SLEEPING = """
import sys
import catenary as cat
arm = cat.attach(sys.argv[1])
arm.wait()
print("sleeping", flush=True)
while True:
    arm.wait()
"""


def test_a_stopped_reader_delays_no_other_reader() -> None:
    """A woken reader passes the wake-up on, but a stopped one does not."""
    with own_name("stopped") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        with (
            cat.attach(name) as arm,
            started(SLEEPING, name) as one,
            started(SLEEPING, name) as two,
        ):
            assert one.line() == two.line() == "sleeping"
            for _ in range(20):
                one.process.send_signal(signal.SIGSTOP)
                for _ in range(100):
                    assert arm.wait(timeout=60.0)
                one.process.send_signal(signal.SIGCONT)


def has_every_cycle(arm: cat.share.Reader) -> bool:
    """Return False if this process was delayed between the two calls."""
    rows, lost = arm.rows(after=arm.number - 500)
    return lost == 0 and bool((np.diff(rows["number"]) == 1).all())


@pytest.mark.parametrize("text", [READING, SLEEPING])
def test_killed_readers_affect_neither_loop_nor_readers(text: str) -> None:
    with own_name("reader") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        with cat.attach(name) as arm:
            for _ in range(3):
                with started(text, name) as victim, started(text, name) as second:
                    assert victim.line()
                    assert second.line()
                    victim.kill()
                    second.kill()
                assert arm.alive
                before = arm.number
                assert arm.wait(timeout=60.0)
                assert comes_true(lambda before=before: arm.number > before + 1000)
            assert comes_true(lambda: has_every_cycle(arm))
        with cat.attach(name) as again:
            assert again.wait(timeout=60.0)
