"""A share is left behind: its writer was killed, or the machine was restarted.
It is recognised as stale, even if another process has the writer's ID. Reading does not remove it.
A new writer replaces a stale share, but not a live one.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.share.process import this_process
from catenary.virtual import Segment, Servo
from tests.share.names import own_name, state_file
from tests.share.processes import LOOP, started

LISTEN = "import sys, catenary as cat; print(cat.attach(sys.argv[1], stale=True).state)"


@contextmanager
def open_share(name: str) -> Iterator[None]:
    """Yield a loop with a share, in this process."""
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            yield


def test_reading_does_not_remove_a_stale_share() -> None:
    with own_name("stale") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        with pytest.raises(ShareError, match=f"belongs to process {loop.process.pid}"):
            cat.Share(name).__enter__()
        loop.kill()
        for _ in range(2):
            said = subprocess.run(
                [sys.executable, "-c", LISTEN, name], capture_output=True, text=True, check=True
            )
            assert said.stdout == "dead\n"
        assert state_file(name).exists()
        with started(LOOP, name) as second:
            assert second.line() == "running"
            assert cat.attach(name).layout.writer.pid == second.process.pid


@pytest.mark.parametrize("field", ["start_time", "boot_id"])
def test_another_process_with_the_id_of_the_writer(field: str) -> None:
    """Simulate that this process has the ID of the writer, or that the machine was restarted."""
    me = this_process()
    assert me.is_alive
    written = f'"{field}":' + (f"{me.start_time}" if field == "start_time" else f'"{me.boot_id}"')
    other = written[:-2] + ("0" if written[-2] != "0" else "1") + written[-1]
    with own_name("number") as name:
        path = state_file(name)
        with open_share(name):
            content = path.read_bytes()
            assert cat.attach(name).alive
        assert written.encode() in content
        path.write_bytes(content.replace(written.encode(), other.encode()))
        with pytest.raises(ShareError, match=f"stale: process {os.getpid()}"):
            cat.attach(name)
        with open_share(name):
            assert cat.attach(name).alive
        assert not path.exists()


def test_a_zombie_process_counts_as_dead() -> None:
    with own_name("zombie") as name, started(LOOP, name) as loop:
        assert loop.line() == "running"
        reader = cat.attach(name)
        os.kill(loop.process.pid, 9)
        while reader.wait():
            pass
        assert reader.state == "dead"  # its exit status has not been read yet
