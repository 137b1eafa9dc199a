"""Other users of this machine: programs that run under their ids, in mounts of their own."""

from __future__ import annotations

import grp
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache

from tests.share.processes import Program

ALICE, BOB, MALLORY = 64001, 64002, 64003  # ids that no user has
TIMEOUT = 60.0  # [s] of a program; a machine stops for a while
MOUNTS = (
    "mount -t tmpfs tmpfs /dev/shm && mount -t tmpfs -o mode=755 tmpfs /run && "
    "echo ready && exec sleep 600"
)
TOOLS = ("unshare", "nsenter", "setpriv", "mount")


def operators() -> grp.struct_group:
    """Return a group that exists, other than root's."""
    return next(group for group in grp.getgrall() if group.gr_gid)


@dataclass(frozen=True)
class Machine:
    """/run and /dev/shm, empty, for the programs that run in them."""

    holder: int  # the process that keeps the mounts

    def command(
        self, uid: int, program: str, arguments: Sequence[str], group: bool, gid: int | None = None
    ) -> list[str]:
        gid = uid if gid is None else gid
        groups = f"--groups={operators().gr_gid}" if group else "--clear-groups"
        become = ["setpriv", f"--reuid={uid}", f"--regid={gid}", groups]
        enter = ["nsenter", f"--target={self.holder}", "--mount", "--", *become]
        return [*enter, "env", "HOME=/tmp", sys.executable, "-c", program, *arguments]

    def run(
        self,
        uid: int,
        program: str,
        *arguments: str,
        group: bool = False,
        gid: int | None = None,
    ) -> list[str]:
        """Run a program to its end, and return its lines.

        Args:
            uid: user of the program.
            program: text of the program.
            arguments: its arguments.
            group: True: the user is a member of `operators`.
            gid: primary group of the user; None: the group with the user's number.
        """
        done = subprocess.run(
            self.command(uid, program, arguments, group, gid),
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    @contextmanager
    def started(
        self, uid: int, program: str, *arguments: str, group: bool = False
    ) -> Iterator[Program]:
        """Run a program in the background: `line` reads what it prints."""
        running = Program.of(self.command(uid, program, arguments, group))
        try:
            yield running
        finally:
            running.kill()
            running.close()


@cache
def refusal() -> str:
    """Return why there cannot be other users here; "" if there can."""
    if os.geteuid() != 0:
        return "only root can become another user"
    lacking = [tool for tool in TOOLS if shutil.which(tool) is None]
    if lacking:
        return f"not installed: {', '.join(lacking)}"
    become = ["setpriv", f"--reuid={MALLORY}", f"--regid={MALLORY}", "--clear-groups"]
    command = ["unshare", "--mount", *become, sys.executable, "-c", "import catenary"]
    tried = subprocess.run(command, capture_output=True, text=True, check=False)
    return (tried.stderr.strip() or "refused").splitlines()[-1] if tried.returncode else ""


@contextmanager
def machine() -> Iterator[Machine]:
    """Yield a machine with mounts of its own."""
    with subprocess.Popen(
        ["unshare", "--mount", "--propagation", "private", "sh", "-c", MOUNTS],
        stdout=subprocess.PIPE,
        text=True,
    ) as holder:
        try:
            assert holder.stdout is not None
            assert holder.stdout.readline() == "ready\n"
            yield Machine(holder.pid)
        finally:
            holder.kill()
