"""A loop is killed (kill -9) while other processes read its share.
Waiting and polling readers are notified, and a client with its next command. All shared cycles stay
readable and consistent. A new loop takes the name. Old readers see the last cycles of the old one.
"""

import numpy as np
import pytest

import catenary as cat
from catenary.errors import LeaseError, ShareError
from catenary.virtual import Segment, Servo
from tests.share.names import own_name
from tests.share.processes import LOOP, started

READER = """
import sys
import catenary as cat
with cat.attach(sys.argv[1]) as arm:
    arm.wait()
    print("attached", flush=True)
    while arm.wait():
        arm.read()
    print(arm.state, flush=True)
"""


def test_readers_are_notified_and_keep_the_shared_cycles() -> None:
    with own_name("writer") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        with started(READER, name) as other, cat.attach(name) as arm:
            assert other.line() == "attached"
            assert arm.alive
            loop.kill()
            assert other.line() == "dead"
            while arm.wait():
                pass
            assert arm.state == "dead"
            rows, _ = arm.rows(after=0)
            assert len(rows) >= arm.layout.rows.count - 1  # except one that was being written
            assert (np.diff(rows["number"]) == 1).all()
            assert rows["number"][-1] == arm.number
            steps = np.diff(rows["commanded_position"], axis=0)
            assert steps == pytest.approx(1e-6, abs=1e-9)
            assert_replaced(name, arm)


def test_a_client_is_notified() -> None:
    with own_name("commanded") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        with cat.attach(name) as arm:
            command = arm.lease(axes=[0], for_=3600.0)
            command.send(position=0.1)
            loop.kill()
            with pytest.raises(LeaseError, match=f"has died: process {loop.process.pid}"):
                command.send(position=0.2)


def assert_replaced(name: str, old: cat.share.Reader) -> None:
    last = old.number
    with pytest.raises(ShareError, match=r"is stale: process \d+ .* has died"):
        cat.attach(name)
    assert cat.attach(name, stale=True).number == last
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            with cat.attach(name) as new:
                assert new.alive
                assert len(new.layout.axes) == 1
            assert (old.state, old.number, len(old.layout.axes)) == ("dead", last, 2)
    with pytest.raises(ShareError, match="there is no share"):
        cat.attach(name, stale=True)
