"""Permissions of a share, tested as another user. Hostile users: see tests/attack."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.share import folder
from catenary.virtual import Segment, Servo
from tests.share.names import files_of

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
        cat.share.Mutex(name, uid=0)
    else:
        with cat.attach(name) as arm:
            print(arm.read()["number"] > 0)
            if verb == "command":
                with arm.lease(axes=[0], for_=600.0) as command:
                    command.send(position=0.0)
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
    ("mode", "verb", "expected"),
    [
        (0o600, "read", ["no permission to read"]),
        (0o604, "read", ["True"]),
        (0o604, "command", ["True", "no permission to command"]),
        (0o606, "command", ["True"]),
    ],
)
def test_mode_decides_what_another_user_can_do(
    name: str, mode: int, verb: str, expected: list[str]
) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name, mode=mode) as share, cat.Loop(arm, sink=share) as loop:
            folder.prepare(folder.own_folder(), 0o606)  # as another share of this user does
            next(loop)
            found = as_nobody(name, verb)
            next(loop)
            share.apply(arm)
    assert len(found) == len(expected)
    for line, part in zip(found, expected, strict=True):
        assert part in line


@pytest.mark.parametrize("mode", [0o600, 0o660, 0o666])
def test_only_the_writer_can_write_cycles(name: str, mode: int) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name, mode=mode) as share, cat.Loop(arm, sink=share):
            requests, cycles, desk = sorted(files_of(name))
            assert (requests.name, requests.stat().st_mode & 0o777) == (f"remote-{name}", mode)
            assert (cycles.name, cycles.stat().st_mode & 0o022) == (f"share-{name}", 0)
            assert (desk.name, desk.stat().st_mode & 0o777) == (f"socket-{name}", mode)


def test_full_file_system_is_reported_and_leaves_no_files(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def allocate(descriptor: int, offset: int, size: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("catenary.share.memory.os.posix_fallocate", allocate)
    segment = Segment([Servo()])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        share = cat.Share(name)
        no_room = pytest.raises(ShareError, match=r"not enough space in .* MiB needed")
        with no_room, share, cat.Loop(arm, sink=share):
            pass
        assert segment[0].state & 0x0F == 2  # PRE-OP
    assert not files_of(name)


def test_failed_allocation_of_the_desk_leaves_no_files(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(name: str, size: int) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("catenary.share.command_table.make_sealed", refused)
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        share = cat.Share(name)
        with pytest.raises(OSError, match="Too many"), share, cat.Loop(arm, sink=share):
            pass
    assert not files_of(name)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_mutex_of_another_user_is_refused(name: str) -> None:
    mutex = cat.share.Mutex(name)
    assert "belongs to another user" in as_nobody(name, "mutex")[0]
    mutex.unlink()
