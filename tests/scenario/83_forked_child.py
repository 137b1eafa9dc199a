"""A program forks while its loop is open and a lease is held. The child leaves the copied blocks by
an exception or sys.exit. The loop, its share and the lease belong to the parent.
They continue, and nothing of them is removed.
"""

import subprocess
import sys

from tests.share.names import files_of, own_name

PROGRAM = """
import os, sys
import catenary as cat

name = sys.argv[1]
with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
    loop = cat.Loop(arm, sink=(share := cat.Share(name)))
    share.__enter__()
    loop.__enter__()
    next(loop)
    reader = cat.attach(name)
    command = reader.lease(for_=3600.0)
    share.apply(arm)
    child = os.fork()
    if child == 0:
        command.__exit__(None, None, None)
        share.__exit__(None, None, None)
        loop.__exit__(None, None, None)
        main.__exit__(None, None, None)
        os._exit(0)
    os.waitpid(child, 0)
    before = reader.number
    next(loop)
    print(reader.state, reader.number > before, cat.attach(name).alive, share.apply(arm))
    command.send(position=0.0)
    loop.__exit__(None, None, None)
    share.__exit__(None, None, None)
    print(reader.state)
"""


def test_the_exit_of_a_child_does_not_affect_the_parent() -> None:
    with own_name("fork") as name:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PROGRAM, name],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout.splitlines() == ["running True True []", "ended"]
        assert not files_of(name)
