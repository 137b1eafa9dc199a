"""Attacks of other users on shares and mutexes: read, command, lock, take, damage.

Alice runs a loop; Bob is an operator, of her group; Mallory is neither.
"""

from __future__ import annotations

import pytest

from catenary.doctor.share_folder import expected
from tests.attack.users import ALICE, BOB, MALLORY, Machine, operators

LOOP = """
import sys
import catenary as cat
with cat.MainDevice(cat.Segment([cat.virtual.Servo()])) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
    stop = cat.StopPolicy(on_axis_stopped="event")  # operators may stop axes
    with (
        cat.Share("arm", mode=int(sys.argv[1], 8)) as share,
        cat.Loop(arm, sink=share, stop=stop) as loop,
    ):
        next(loop)
        print("running", flush=True)
        while not sys.stdin.closed:
            next(loop)
            if ends := share.apply(arm):
                print(*ends, arm.actual.position[0], sep="; ", flush=True)
"""
MAKE_FOLDER = """
import sys
from pathlib import Path
from catenary.doctor.share_folder import write_folder
write_folder(Path("/run/catenary"), sys.argv[1])
"""
COMMAND = f"""
import catenary as cat
with cat.attach("arm", uid={ALICE}) as arm, arm.lease(axes=[0], for_=600.0) as command:
    print(arm.read()["number"] > 0)
    before = arm.number
    command.send(position=0.001)
    while arm.read()["commanded_position"][0] != 0.001:
        arm.wait(timeout=10.0)
    print("moved")
"""
TRY_NAMESPACE = """
import subprocess
print(subprocess.run(["unshare", "--user", "--map-root-user", "true"]).returncode)
"""
SAY = """
import catenary as cat
def said(action):
    try:
        action()
    except (cat.CatenaryError, OSError) as error:
        print(type(error).__name__, str(getattr(error, "message", error)))
    else:
        print("done")
"""


def make_group_folder(machine: Machine) -> None:
    assert machine.run(0, MAKE_FOLDER, expected(operators().gr_name)) == []


def test_operators_share_a_robot(machine: Machine) -> None:
    """In /run/catenary, as `catenary doctor --apply` makes it; Mallory is not let in."""
    make_group_folder(machine)
    with machine.started(ALICE, LOOP, "660", group=True) as loop:
        assert loop.line() == "running"
        assert machine.run(BOB, COMMAND, group=True) == ["True", "moved"]
        assert "released" in loop.line()
        [line] = machine.run(MALLORY, f'{SAY}\nsaid(lambda: cat.attach("arm", uid={ALICE}))')
        assert "no permission to read" in line


def test_operators_share_a_robot_without_a_common_folder(machine: Machine) -> None:
    """Bob's only group is Alice's: the folder lets him pass, but neither list nor lock."""
    with machine.started(ALICE, LOOP, "660") as loop:
        assert loop.line() == "running"
        assert machine.run(BOB, COMMAND, gid=ALICE) == ["True", "moved"]
        look = f"{SAY}import os\nsaid(lambda: os.open('/dev/shm/catenary-{ALICE}', os.O_RDONLY))"
        [line] = machine.run(BOB, look, gid=ALICE)
        assert line.startswith("PermissionError")


@pytest.mark.parametrize("mode", ["600", "666"])
def test_a_stranger_cannot_lock_or_write(machine: Machine, mode: str) -> None:
    """`flock` on /dev/shm stopped every share of every user."""
    lock = """
import fcntl, os
fcntl.flock(os.open("/dev/shm", os.O_RDONLY), fcntl.LOCK_EX)
print("locked", flush=True)
input()
"""
    attempts = f"""{SAY}
import os
folder = "/dev/shm/catenary-{ALICE}"
said(lambda: os.open(folder, os.O_RDONLY))
said(lambda: os.open(folder + "/x", os.O_RDWR | os.O_CREAT))
said(lambda: os.truncate(folder + "/share-arm", 0))
said(lambda: os.rename(folder + "/share-arm", folder + "/y"))
"""
    with machine.started(MALLORY, lock) as mallory:
        assert mallory.line() == "locked"
        with machine.started(ALICE, LOOP, mode) as loop:
            assert loop.line() == "running"
            lines = machine.run(MALLORY, attempts)
            assert [line.split()[0] for line in lines] == ["PermissionError"] * 4


def test_the_owner_of_a_taken_folder_is_named(machine: Machine) -> None:
    """Denial, not deception: /dev/shm is open to all users. /run/catenary cannot be taken."""
    assert machine.run(MALLORY, f"import os; os.mkdir('/dev/shm/catenary-{ALICE}', 0o777)") == []
    take = f'{SAY}\nsaid(lambda: cat.share.Mutex("tool"))'
    [line] = machine.run(ALICE, take)
    assert f"belongs to user {MALLORY} (you are user {ALICE})" in line
    make_group_folder(machine)
    assert machine.run(ALICE, take, group=True) == ["done"]


def test_users_in_namespaces_of_their_own_take_no_folder_of_root(machine: Machine) -> None:
    """An ordinary user is root in a private network, and took the folder of the real root."""
    take = f"""
import subprocess, sys
program = {f'{SAY}said(lambda: cat.share.Mutex("tool"))'!r}
private = ["unshare", "--user", "--map-root-user"] if len(sys.argv) > 1 else []
subprocess.run([*private, sys.executable, "-c", program], check=True)
"""
    for user in (ALICE, BOB):
        if machine.run(user, TRY_NAMESPACE) != ["0"]:
            pytest.skip("no user namespaces for ordinary users")
        assert machine.run(user, take, "private") == ["done"]
        assert machine.run(user, take) == ["done"]  # the same mutex
    assert machine.run(0, take) == ["done"]


def test_a_share_of_another_user_is_refused_unless_requested(machine: Machine) -> None:
    """The owner of a share can crash its readers by truncating the file (SIGBUS)."""
    make_group_folder(machine)
    with machine.started(MALLORY, LOOP, "644", group=True) as loop:
        assert loop.line() == "running"
        [line] = machine.run(ALICE, f'{SAY}\nsaid(lambda: cat.attach("arm"))', group=True)
        assert f"belongs to another user ({MALLORY})" in line
        asked = f'{SAY}\nsaid(lambda: cat.attach("arm", uid={MALLORY}))'
        assert machine.run(ALICE, asked, group=True) == ["done"]
        taken = f'{SAY}\nsaid(lambda: cat.Share("arm").__enter__())'
        [line] = machine.run(ALICE, taken, group=True)
        assert "exists and cannot be replaced" in line


def test_roots_share_needs_no_word(machine: Machine) -> None:
    with machine.started(0, LOOP, "644") as loop:
        assert loop.line() == "running"
        assert machine.run(ALICE, f'{SAY}\nsaid(lambda: cat.attach("arm"))') == ["done"]


def test_a_mutex_of_another_user_is_refused_unless_requested(machine: Machine) -> None:
    """Its robust list holds pointers: a forged file crashed the C library (SIGSEGV)."""
    make_group_folder(machine)
    evil = """
import os
from pathlib import Path
from catenary.share import Mutex
mutex = Mutex("tool", mode=0o666)
data = bytearray(mutex.path.read_bytes())
data[16 + 16 : 16 + 40] = b"\\x41" * 24
mutex.path.write_bytes(data)
mutex.path.chmod(0o666)
"""
    assert machine.run(MALLORY, evil, group=True) == []
    [line] = machine.run(ALICE, f'{SAY}\nsaid(lambda: cat.share.Mutex("tool"))', group=True)
    assert f"belongs to another user ({MALLORY})" in line
    asked = f'{SAY}\nsaid(lambda: cat.share.Mutex("tool", uid={MALLORY}))'
    [line] = machine.run(ALICE, asked, group=True)
    assert "more users can write to it than mode=0o600 allows" in line


def test_operators_use_a_mutex_together(machine: Machine) -> None:
    make_group_folder(machine)
    made = 'from catenary.share import Mutex\nwith Mutex("tool", mode=0o660): print("mine")'
    assert machine.run(ALICE, made, group=True) == ["mine"]
    theirs = made.replace("mode=0o660", f"mode=0o660, uid={ALICE}")
    assert machine.run(BOB, theirs, group=True) == ["mine"]


HOSTILE_OPERATOR = f"""{SAY}
import fcntl, mmap, os, sys
from catenary.share import command_table, desk_socket
folder = "/run/catenary"
said(lambda: os.truncate(folder + "/share-arm", 0))
said(lambda: os.unlink(folder + "/share-arm"))
said(lambda: os.unlink(folder + "/socket-arm"))
kept = []
take = command_table.map_sealed
def keep(descriptor, size):
    kept.append(os.dup(descriptor))
    return take(descriptor, size)
command_table.map_sealed = keep
arm = cat.attach("arm", uid={ALICE})
lease = arm.lease(axes=[0], for_=600.0)
[memory] = kept
size = os.fstat(memory).st_size
said(lambda: os.ftruncate(memory, 0))
said(lambda: os.ftruncate(memory, 2 * size))
said(lambda: fcntl.fcntl(memory, fcntl.F_ADD_SEALS, fcntl.F_SEAL_WRITE))
mapped = mmap.mmap(memory, size)
for pattern in (b"\\xff", b"\\x00", b"\\x7f", b"\\x01"):
    mapped[64:] = pattern * (size - 64)
    before = arm.number
    while arm.number < before + 100 and arm.wait(timeout=10.0):
        pass
    print(arm.number >= before + 100)
import ctypes
PUNCH_HOLE, KEEP_SIZE = 2, 1
libc = ctypes.CDLL(None, use_errno=True)
libc.fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
assert libc.fallocate(memory, PUNCH_HOLE | KEEP_SIZE, 0, size) == 0
before = arm.number
while arm.number < before + 100 and arm.wait(timeout=10.0):
    pass
print(arm.number >= before + 100)
"""
BADLY_NAMED_OPERATOR = f"""
from pathlib import Path
import catenary as cat
with cat.attach("arm", uid={ALICE}) as arm, arm.lease(axes=[0], for_=600.0) as command:
    Path("/proc/self/comm").write_bytes(b"\\xff) Z 1")
    before = arm.number
    while arm.number < before + 100 and arm.wait(timeout=10.0):
        command.send(position=0.0)
    print(arm.number >= before + 100)
"""


def test_an_operators_process_can_have_any_name(machine: Machine) -> None:
    """The loop asks the kernel for it. A name that is not UTF-8 ended the loop."""
    make_group_folder(machine)
    with machine.started(ALICE, LOOP, "660", group=True) as loop:
        assert loop.line() == "running"
        assert machine.run(BOB, BADLY_NAMED_OPERATOR, group=True) == ["True"]
        assert "released" in loop.line()


def test_an_operator_cannot_break_the_loop(machine: Machine) -> None:
    """Bob may command. He cannot shorten memory that the loop uses, or hang it by numbers."""
    make_group_folder(machine)
    with machine.started(ALICE, LOOP, "660", group=True) as loop:
        assert loop.line() == "running"
        lines = machine.run(BOB, HOSTILE_OPERATOR, group=True)
        assert [line.split()[0] for line in lines[:6]] == ["PermissionError"] * 6
        assert lines[6:] == ["True"] * 5
        assert loop.process.poll() is None
