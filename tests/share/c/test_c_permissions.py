"""Permissions of a share for a C program of another user, as in tests/share/test_permissions.py."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.share import folder
from catenary.virtual import Segment, Servo
from tests.share.c.library import PERMISSION

NOBODY = 65534


@pytest.fixture
def public_program(program: Path) -> Iterator[Path]:
    """A copy of the program that all users can execute."""
    with tempfile.TemporaryDirectory() as place:
        os.chmod(place, 0o755)
        copy = Path(place) / "client"
        shutil.copy(program, copy)
        copy.chmod(0o755)
        yield copy


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        (0o600, [PERMISSION]),
        (0o604, [0, PERMISSION]),
        (0o606, [0, 0]),
    ],
)
def test_mode_decides_what_another_user_can_do(
    name: str, public_program: Path, mode: int, expected: list[int]
) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Share(name, mode=mode) as share, cat.Loop(arm, sink=share) as loop:
            folder.prepare(folder.own_folder(), 0o606)  # as another share of this user does
            next(loop)
            command = [public_program, "command", name]
            done = subprocess.run(
                command, user=NOBODY, group=NOBODY, extra_groups=[], capture_output=True, text=True
            )
            assert done.returncode == 0, done.stderr
            next(loop)
            share.apply(arm)
    assert [int(line.split()[0]) for line in done.stdout.splitlines()] == expected
