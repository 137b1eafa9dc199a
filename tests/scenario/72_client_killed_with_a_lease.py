"""A client commands an axis of a moving arm from another process and is killed (kill -9).
The loop detects its death long before the lease ends. The axis holds its commanded position.
The next client can lease the axis.
"""

import pytest

import catenary as cat
from catenary.errors import LeaseError
from catenary.share import LeaseEnd, Reason
from catenary.virtual import Segment, Servo
from tests.share.names import own_name
from tests.share.processes import comes_true, started

CLIENT = """
import sys
import catenary as cat
with cat.attach(sys.argv[1]) as arm, arm.lease(axes=[1], for_=3600.0) as command:
    position = 0.0
    while True:
        position += 1e-5
        command.send(position=position)
        arm.wait()
        if 0.01 <= position < 0.01 + 1e-5:
            print("moving", flush=True)
"""


def test_the_axis_of_a_killed_client_holds_and_becomes_free() -> None:
    with own_name("lease") as name, cat.MainDevice(Segment([Servo(), Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            ended: list[LeaseEnd] = []

            def cycle() -> bool:
                for _ in range(20):
                    next(loop)
                    ended.extend(share.apply(arm))
                return bool(ended)

            with started(CLIENT, name) as client:
                assert comes_true(lambda: cycle() or arm.target.position[1] > 0.01)
                assert ended == []
                with cat.attach(name) as reader:
                    with pytest.raises(LeaseError, match=f"leased to process {client.process.pid}"):
                        reader.lease(axes=[1])
                    client.kill()
                    assert comes_true(cycle)
                    [end] = ended
                    assert (end.axes, end.reason) == ((arm.names[1],), Reason.DIED)
                    assert end.client.pid == client.process.pid
                    held = arm.target.position[1]
                    for _ in range(10):
                        cycle()
                    assert arm.target.position[1] == held > 0.01
                    assert arm.actual.position[1] == pytest.approx(held, abs=1e-4)
                    assert arm.actual.position[0] == pytest.approx(0.0, abs=1e-4)
                    with reader.lease(axes=[1], for_=3600.0) as command:
                        command.send(position=held)
                        assert share.commands()[0].axes == (1,)
