"""A process is killed (kill -9) while it holds a mutex: its own, or that of a loop's lease desk.
The next owner gets the mutex and is informed.
Leases work as before, and the loop never waits.
"""

import catenary as cat
from catenary.share import Mutex
from catenary.virtual import Segment, Servo
from tests.share.names import own_name
from tests.share.processes import started

OWNER = """
import sys
from catenary.share import Mutex
with Mutex(sys.argv[1]):
    print("mine", flush=True)
    sys.stdin.readline()
"""
IN_MID_LEASE = """
import sys
import catenary as cat
with cat.attach(sys.argv[1]) as arm:
    arm.lease(axes=[0], for_=3600.0)
    arm._desk.mutex.lock(0)
    arm._desk.holders[:] = 77  # a lease that is being taken, and never will be
    print("mine", flush=True)
    sys.stdin.readline()
"""


def test_the_next_owner_is_informed() -> None:
    with own_name("mutex") as name:
        with started(OWNER, name) as owner:
            assert owner.line() == "mine"
            mutex = Mutex(name)
            assert not mutex.acquire(timeout=0.0)
            owner.kill()
        with mutex:
            assert mutex.recovered
        with mutex:
            assert not mutex.recovered


def test_a_lease_is_available_after_a_client_died_during_its_request() -> None:
    with own_name("desk") as name, cat.MainDevice(Segment([Servo(), Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            with started(IN_MID_LEASE, name) as client:
                assert client.line() == "mine"
                next(loop)
                share.apply(arm)  # while another process holds the mutex
                client.kill()
            with cat.attach(name) as reader, reader.lease(for_=3600.0) as command:
                command.send(position=[0.001, 0.002])
                next(loop)
                share.apply(arm)
                assert arm.target.position.tolist() == [0.001, 0.002]
