"""The mode of the files says who may read and command: tried as another user."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.virtual import Segment, Servo

NOBODY = 65534
TRY = """
import os, sys
import catenary as cat
import catenary.share, catenary.share.lease
os.setgroups([])
os.setgid(65534)
os.setuid(65534)
name, verb = sys.argv[1:]
try:
    if verb == "mutex":
        cat.share.Mutex(name)
    elif verb == "take":
        with cat.Share(name):
            pass
    else:
        with cat.attach(name) as arm:
            print(arm.read()["number"] > 0)
            if verb == "command":
                arm.lease(axes=[0])
except cat.CatenaryError as error:
    print(error.message)
"""


def as_nobody(name: str, verb: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", TRY, name, verb], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
@pytest.mark.parametrize(
    ("mode", "verb", "said"),
    [
        (0o600, "read", ["may not be read"]),
        (0o604, "read", ["True"]),
        (0o604, "command", ["True", "may not be commanded"]),
        (0o606, "command", ["True"]),
        (0o600, "take", ["belongs to another user"]),
    ],
)
def test_another_user(name: str, mode: int, verb: str, said: list[str]) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name, mode=mode) as share, cat.Loop(arm, sink=share) as loop:
            next(loop)
            found = as_nobody(name, verb)
    assert len(found) == len(said)
    for line, part in zip(found, said, strict=True):
        assert part in line


@pytest.mark.parametrize("room", [0, 1])  # for so many files
def test_a_full_disk_is_told_and_nothing_is_left(
    name: str, room: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [room]

    def allocate(descriptor: int, offset: int, size: int) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        os.ftruncate(descriptor, size)

    monkeypatch.setattr("catenary.share.memory.os.posix_fallocate", allocate)
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        share = cat.Share(name)
        no_room = pytest.raises(ShareError, match=r"/dev/shm has no room for .* MiB")
        with no_room, share, cat.Loop(arm, sink=share):
            pass
        assert segment[0].state & 0x0F == 2  # PRE-OP
    assert not list(Path("/dev/shm").glob(f"*{name}*"))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_mutex_of_another_user(name: str) -> None:
    mutex = cat.share.Mutex(name)
    assert "belongs to another user" in as_nobody(name, "mutex")[0]
    mutex.unlink()
