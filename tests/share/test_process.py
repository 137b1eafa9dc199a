"""Identity of processes, read from /proc."""

from __future__ import annotations

from catenary.share.process import Process, is_running, this_process
from tests.share.processes import started

RENAMED = r"""
import os
with open("/proc/self/comm", "wb") as name:
    name.write(b"\xff) Z 1")
fields = open("/proc/self/stat", "rb").read().rpartition(b")")[2].split()
print(os.getpid(), int(fields[19]), flush=True)
input()
"""


def test_process_can_have_any_name() -> None:
    """A client with such a name once ended the loop, which parses /proc/PID/stat."""
    with started(RENAMED) as program:
        pid, start_time = map(int, program.line().split())
        assert is_running(pid)
        here = this_process()
        assert Process(pid, start_time, here.boot_id, "").is_alive
        assert not Process(pid, start_time + 1, here.boot_id, "").is_alive
    assert not is_running(pid)
