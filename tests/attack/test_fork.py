"""Attack: a program forks while its loop runs. The child can do nothing to the parent's devices."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.attack.line_on_a_wire import LINE, served

PROGRAM = """
import ctypes, multiprocessing, os, pathlib, signal, sys
import catenary as cat

def in_child(what, fork=os.fork):
    child = fork()
    if child == 0:
        signal.alarm(20)  # a child that hangs is an error, too
        what()
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

def expect(error, call):
    try:
        call()
    except error as raised:
        assert "forked child" in str(raised), raised
    else:
        raise AssertionError(f"{call} did not raise")

def use():
    expect(RuntimeError, lambda: next(loop))
    expect(RuntimeError, lambda: next(iteration))
    expect(RuntimeError, lambda: main.link)
    expect(RuntimeError, lambda: main.scan())
    expect(RuntimeError, lambda: arm.subs[0].sdo.read(0x1018, 1))
    # The views are there. In real time, the pages of the cycle are wiped instead of copied.
    assert loop.networks[0].session.views.statusword.any() == sys.argv[1].startswith("virtual")
    arm.target.position[:] = 1.0
    loop.log, loop.timing, loop.plan
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    packets = [fd for fd in os.listdir("/proc/self/fd") if is_packet(fd)]
    assert not packets, packets

def is_packet(fd):
    try:
        link = os.readlink(f"/proc/self/fd/{fd}")
    except OSError:
        return False
    rows = pathlib.Path("/proc/net/packet").read_text().split("\\n")[1:]
    return link in [f"socket:[{row.split()[8]}]" for row in rows if row]

def leave():
    loop.__exit__(None, None, None)
    main.__exit__(None, None, None)

def delete():
    global loop, iteration
    del loop, iteration
    import gc
    gc.collect()

def good(count):
    for number, cycle in enumerate(iteration):
        arm.target.position[:] = arm.actual.position
        assert arm.stopped == (None,), arm.stopped
        if number == count:
            return

main = cat.MainDevice(sys.argv[1])
main.open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
loop = cat.Loop(arm, execution=sys.argv[2], period=4e-3, priority=None,
                stop=cat.StopPolicy(lost_limit=1000, late_limit=10.0),
                watchdog=6.0)
loop.__enter__()
iteration = iter(loop)
good(20)
for what in (use, leave, delete):
    assert in_child(what) == 0, what
    good(20)
for what in (leave, delete):  # of a C library: without Python's hooks
    assert in_child(what, ctypes.PyDLL(None).fork) == 0, what
    good(20)
child = os.fork()
if child == 0:
    signal.alarm(20)
    sys.exit(0)  # leaves as a program does: atexit, finalizers
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
good(20)
context = multiprocessing.get_context("fork")
with context.Pool(2) as pool:  # a user's own children
    assert pool.map(abs, [-1, -2]) == [1, 2]
good(20)
leave()
print("good")
"""
ORPHAN = """
import os, sys, time
import catenary as cat

main = cat.MainDevice(sys.argv[1])
main.open()
ready, tell = os.pipe()
child = os.fork()
if child == 0:
    os.write(tell, b"1")
    time.sleep(60)
    os._exit(0)
os.read(ready, 1)
main.close()
with cat.MainDevice(sys.argv[1]):  # the child keeps neither lock nor socket
    print("reopened")
os.kill(child, 9)
os.waitpid(child, 0)
"""
TERMINATED = """
import os, signal, time
import catenary as cat

with cat.MainDevice("virtual") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    with cat.Loop(arm) as loop:
        next(loop)
        for _ in range(30):
            child = os.fork()
            if child == 0:
                signal.alarm(20)
                while True:
                    time.sleep(1)
            os.kill(child, signal.SIGTERM)
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGTERM
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == set()
print("ended")
"""
INTERRUPTED = """
import ctypes, functools, os, signal, warnings
import catenary as cat

warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns of a fork with threads
with cat.MainDevice("virtual") as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    with cat.Loop(arm) as loop:
        next(loop)
        kill = ctypes.CDLL(None).kill  # unlike os.kill, it runs no handler
        os.register_at_fork(before=functools.partial(kill, os.getpid(), signal.SIGTERM))
        try:
            if os.fork() == 0:
                os._exit(0)
        except SystemExit as end:
            print("ended with", end.code)
"""
RECORDED = """
import os, sys
from catenary.link import Interface, Recorder
from catenary.wire.capture import decode_capture

with Recorder(Interface(sys.argv[1]), sys.argv[2]) as link:
    child = os.fork()
    if child:
        assert os.waitpid(child, 0)[1] == 0
        link.send(bytes.fromhex("ffffffffffff10101010101088a4") + bytes(46))
if child:
    print(len(decode_capture(open(sys.argv[2], "rb").read()).packets))
"""


def run(text: str, *arguments: str) -> str:
    command = [sys.executable, "-X", "dev", "-c", text, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "not left" not in done.stderr
    return done.stdout


@pytest.mark.parametrize("mode", ["threaded", "inline"])
def test_a_child_leaves_the_parents_devices_alone(
    veth: tuple[str, str], tmp_path: Path, mode: str
) -> None:
    with served(veth[1], tmp_path):
        assert run(PROGRAM, veth[0], mode) == "good\n"


@pytest.mark.parametrize("mode", ["threaded", "inline"])
def test_the_same_in_virtual_time(tmp_path: Path, mode: str) -> None:
    file = tmp_path / "line.toml"
    file.write_text(LINE)
    assert run(PROGRAM, f"virtual:{file}", mode) == "good\n"


def test_a_child_keeps_no_interface(veth: tuple[str, str]) -> None:
    assert run(ORPHAN, veth[0]) == "reopened\n"


def test_a_child_writes_nothing_into_a_recording(veth: tuple[str, str], tmp_path: Path) -> None:
    assert run(RECORDED, veth[0], str(tmp_path / "frames.pcapng")) == "1\n"


def test_sigterm_in_the_first_moments_of_a_child_ends_it() -> None:
    assert run(TERMINATED) == "ended\n"


def test_sigterm_while_the_parent_forks_ends_the_parent() -> None:
    assert run(INTERRUPTED) == "ended with 143\n"
