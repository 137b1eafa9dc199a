"""Child processes: output, end on request, and end with the parent."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys

import pytest

from catenary.realtime.child import start_program, start_python

IGNORES_SIGTERM = """
import signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("ready", flush=True)
signal.pause()
"""
WAITING = """
import os, signal, sys
print(os.getpid(), os.getsid(0), *sys.argv[1:], flush=True)
signal.pause()
"""


@pytest.fixture
def script(tmp_path):
    def write(text: str) -> str:
        path = tmp_path / "script.py"
        path.write_text(text)
        return str(path)

    return write


def test_a_script_runs_in_its_own_session_with_its_arguments(script):
    with start_python([script(WAITING), "--one", "two"]) as child:
        line = child.read_line(20.0)
        assert line == f"{child.pid} {child.pid} --one two"
        assert child.running
    assert not child.running


def test_run_a_module():
    with start_python(["-m", "platform", "terse"]) as child:
        assert "Linux" in (child.read_line(20.0) or "")


def test_run_a_program():
    with start_program(["sh", "-c", "echo $1", "sh", "spoken"]) as child:
        assert child.read_line(20.0) == "spoken"


def test_the_output_ends_with_the_child():
    with start_program(["sh", "-c", "echo a; echo b"]) as child:
        assert [child.read_line(20.0) for _ in range(3)] == ["a", "b", None]


def test_read_line_times_out(script):
    with start_python([script(WAITING)]) as child:
        child.read_line(20.0)
        assert child.read_line(0.0) is None


def test_end_by_sigterm(script):
    child = start_python([script(WAITING)])
    child.read_line(20.0)
    assert child.end() == -signal.SIGTERM
    assert child.end() == -signal.SIGTERM


def test_a_child_that_ignores_sigterm_is_killed(script):
    child = start_python([script(IGNORES_SIGTERM)])
    assert child.read_line(20.0) == "ready"
    assert child.end(0.05) == -signal.SIGKILL


def test_a_child_ends_with_its_parent(script):
    parent = (
        "from catenary.realtime.child import start_python; import sys, time\n"
        "child = start_python([sys.argv[1]])\n"
        "print(child.read_line(20.0), flush=True)\n"
        "sys.stdin.read()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", parent, script(WAITING)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    pid = int(process.stdout.readline().split()[0])
    watched = os.pidfd_open(pid)
    process.kill()
    process.communicate()
    assert select.select([watched], [], [], 20.0)[0] == [watched]
    os.close(watched)


@pytest.mark.parametrize("arguments", [[], ["-m"]])
def test_nothing_to_run_is_an_error(arguments):
    with pytest.raises(ValueError, match="arguments must be"):
        start_python(arguments)
    with pytest.raises(ValueError, match="command is empty"):
        start_program([])
