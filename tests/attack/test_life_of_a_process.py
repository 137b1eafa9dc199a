"""Attack: a program ends unexpectedly. Its axes are stopped if possible."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.attack.line_on_a_wire import START, looping, program, served

SETUP = """
import atexit
atexit.register(lambda: print("at the end", state()))  # after the handlers registered later
import os, signal
import catenary as cat

segment = cat.Segment([cat.virtual.Servo()])
main = cat.MainDevice(segment)
main.open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
loop = cat.Loop(arm, stop=cat.StopPolicy(late_limit=0.0)).__enter__()
next(loop)

def state():
    return int.from_bytes(segment.core.peek(0, 0x0130, 2), "little")

assert state() == 8
"""
DELETED = """
import warnings

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    del loop
print([each.category.__name__ for each in caught], state())
"""
DELETED_ELSEWHERE = """
import threading

def delete():
    global loop
    del loop

thread = threading.Thread(target=delete)
thread.start()
thread.join()
print(state())
try:
    os.kill(os.getpid(), signal.SIGTERM)
except SystemExit:
    print("still handled")
"""
HANGUP = """
import contextlib

loop.__exit__(None, None, None)
try:
    with loop:
        os.kill(os.getpid(), signal.SIGHUP)
        next(loop)
        print("ignored", state())
except SystemExit as end:
    print(end.code, state())
"""


def run(text: str, *, ignored: bool = False) -> tuple[str, str]:
    def ignore() -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)

    done = subprocess.run(
        [sys.executable, "-W", "default", "-c", SETUP + text],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        preexec_fn=ignore,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_a_deleted_loop_is_left_with_a_warning() -> None:
    assert run(DELETED)[0].startswith("['RuntimeWarning'] 2\n")


def test_axes_are_stopped_where_warnings_are_errors() -> None:
    out, err = run('import warnings; warnings.simplefilter("error")\ndel loop\nprint(state())')
    assert out.startswith("2\n")
    assert "a Loop was not left" in err


def test_a_loop_can_be_deleted_in_another_thread() -> None:
    """The garbage collector runs in any thread."""
    out, err = run(DELETED_ELSEWHERE)
    assert out.startswith("2\n")
    assert "ValueError" not in err
    assert "still handled" in out


def test_a_loop_left_open_is_left_at_the_end() -> None:
    out, err = run("")
    assert "RuntimeWarning: a Loop was not left: its axes have been stopped" in err
    assert "Traceback" not in err
    assert out == "at the end 2\n"


def test_sighup_leaves_the_loop() -> None:
    assert run(HANGUP)[0].startswith("129 2\n")


def test_sighup_is_ignored_under_nohup() -> None:
    assert run(HANGUP, ignored=True)[0].startswith("ignored 8\n")


INTERRUPTED_IMPORT = """
import importlib.abc, signal, sys

class CtrlC(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == sys.argv[1]:
            signal.raise_signal(signal.SIGINT)

module = sys.argv[1]
sys.meta_path.insert(0, CtrlC())
from catenary.cli.console import main
sys.argv = ["catenary", "scan", "virtual"]
"""


@pytest.mark.parametrize(
    "module", ["argparse", "catenary.cli.main", "catenary.cli.sii", "catenary.virtual"]
)
def test_ctrl_c_while_the_command_line_is_imported(module: str) -> None:
    text = INTERRUPTED_IMPORT.replace("sys.argv[1]", repr(module)) + "sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_the_command_starts_where_ctrl_c_is_handled() -> None:
    """No command is imported before that."""
    text = (
        "import sys, catenary.cli.console as c; print([m for m in sys.modules if m[:3] == 'cat'])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "['catenary', 'catenary.cli', 'catenary.cli.console']\n"


@pytest.fixture
def hangups_are_delivered() -> Iterator[None]:
    """Programs inherit an ignored SIGHUP, for example from nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("hangups_are_delivered")
def test_sighup_on_a_wire(veth: tuple[str, str], tmp_path: Path) -> None:
    with served(veth[1], tmp_path), looping(veth[0], tmp_path) as loop:
        os.kill(loop.pid, signal.SIGHUP)
        assert loop.process.wait(START) == 129
        with program(STATES, tmp_path, veth[0]) as reading:
            assert reading.read_line(START) == "{'INIT'}"


STATES = """
import sys
from collections.abc import Iterator
import catenary as cat

with cat.MainDevice(sys.argv[1]) as main:
    print({str(sub.read_state().state) for sub in main.passive_scan()})
"""
