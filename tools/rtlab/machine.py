"""The machine of the lab: QEMU with one processor, whose clock counts instructions."""

from __future__ import annotations

import base64
import contextlib
import ctypes
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tools.rtlab.errors import LabError
from tools.rtlab.kernel import Kernel

PROGRAM = "qemu-system-x86_64"
SHIFT = 0  # an instruction takes 2**SHIFT ns
MEMORY_MB = 3072
# On a busy host, one kernel in five hangs at its start, before its first output (QEMU 7.2).
BOOT_SECONDS, BOOTS = 120.0, 4  # [s] of the host until the guest's first output; attempts
PR_SET_PDEATHSIG = 1  # linux/prctl.h
COMMAND_LINE_SIZE = 2048  # of the kernel on x86; longer lines are truncated
END_SECONDS = 30.0  # from a guest's last line to the end of QEMU
KERNEL_ARGUMENTS = (
    *("console=ttyS0", "quiet", "loglevel=3", "panic=-1", "rdinit=/init"),
    *("nokaslr", "norandmaps", "random.trust_cpu=on"),  # all runs must be equal
    *("tsc=reliable", "mitigations=off"),
)


def program() -> str:
    """Return the path of QEMU.

    Raises:
        LabError: QEMU is not installed.
    """
    path = shutil.which(PROGRAM)
    if path is None:
        raise LabError(f"{PROGRAM} is not installed: `sudo apt-get install qemu-system-x86`")
    return path


def version() -> str:
    done = subprocess.run([program(), "--version"], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0].removeprefix("QEMU emulator version ")


def command(kernel: Kernel, root: Path, results: Path, job: Mapping[str, object]) -> list[str]:
    """Return the command that starts QEMU.

    With `sleep=off`, an idle guest advances its clock to the next timer at once. The root is in
    memory from the start, because a disk would answer in the time of the host.

    Raises:
        LabError: The job is too long for the kernel's command line.
    """
    encoded = base64.b64encode(json.dumps(job).encode()).decode()
    line = " ".join((*KERNEL_ARGUMENTS, f"RTLAB_JOB={encoded}"))
    if len(line) >= COMMAND_LINE_SIZE:
        raise LabError(
            f"the command line of the guest has {len(line)} characters, at most"
            f" {COMMAND_LINE_SIZE - 1}: use fewer --options, or a shorter path of the working copy"
        )
    return [
        program(),
        *("-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
        *("-accel", "tcg", "-icount", f"shift={SHIFT},sleep=off", "-rtc", "clock=vm"),
        *("-cpu", "max", "-smp", "1", "-m", str(MEMORY_MB), "-seed", "1"),
        *("-kernel", str(kernel.image), "-initrd", str(root)),
        *("-append", line),
        *("-chardev", "stdio,id=console,signal=off", "-serial", "chardev:console"),
        *("-serial", f"file:{results}"),
    ]


class Guest:
    """Owns a running QEMU."""

    def __init__(self, arguments: Sequence[str], results: Path, seconds: float) -> None:
        self.results = results
        self.started = time.monotonic()
        self.limit = seconds
        self.errors = results.with_name("errors")
        with self.errors.open("wb") as errors:  # QEMU would block on a full pipe
            self.process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                start_new_session=True,  # not ended by Ctrl-C in the terminal, but by us
                preexec_fn=end_with_parent(os.getpid()),
            )

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.started

    def wakes(self) -> bool:
        """Return True if the guest prints something in time, or has ended."""
        if self.limit <= BOOT_SECONDS:
            return True
        return bool(select.select([self.process.stdout], [], [], BOOT_SECONDS)[0])

    def lines(self) -> Iterator[str]:
        """Yield the output of the guest until it turns itself off.

        Raises:
            LabError: The time limit was exceeded.
        """
        unread = b""
        while data := self._read():
            *whole, unread = re.split(rb"\r\x1b\[K|\r*\n", unread + data)  # or an overwritten line
            yield from (line.decode(errors="replace") for line in whole)
        if unread:
            yield unread.decode(errors="replace")

    def _read(self) -> bytes:
        assert self.process.stdout is not None
        left = self.limit - self.seconds
        if left <= 0 or not select.select([self.process.stdout], [], [], left)[0]:
            raise LabError(f"not done within {self.limit / 60:.1f} minutes: raise --minutes")
        return os.read(self.process.stdout.fileno(), 65536)

    def answer(self) -> dict[str, Any]:
        """Return the answer that the guest wrote at its end.

        Raises:
            LabError: There is no answer, or the guest failed.
        """
        try:
            self.process.communicate(timeout=END_SECONDS)
        except subprocess.TimeoutExpired:
            raise LabError(f"QEMU did not end within {END_SECONDS:.0f} s after its guest") from None
        if self.process.returncode != 0:
            errors = self.errors.read_text(errors="replace")
            said = errors.strip().splitlines() or ["it said nothing"]
            raise LabError(f"QEMU ended with status {self.process.returncode}: {said[0]}")
        return understood(self.results.read_text(errors="replace"))

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


def understood(said: str) -> dict[str, Any]:
    """Return an answer from its line of JSON.

    Raises:
        LabError: The line is not JSON, or the command failed.
    """
    try:
        answer: dict[str, Any] = json.loads(said)
    except ValueError:
        raise LabError("the guest ended without an answer; what it printed is above") from None
    if answer["status"] != 0 or answer["result"] is None:
        raise LabError(f"the command ended with status {answer['status']}; its output is above")
    return answer


@contextlib.contextmanager
def started(
    kernel: Kernel, root: Path, job: Mapping[str, object], folder: Path, seconds: float
) -> Iterator[Guest]:
    """Run a guest during the block.

    Args:
        kernel: Kernel of the guest.
        root: Root file system.
        job: Job of the guest.
        folder: Folder for the files of QEMU.
        seconds: Time limit [s].
    """
    with tempfile.TemporaryDirectory(prefix="run-", dir=folder) as name:
        results = Path(name, "results")
        arguments = command(kernel, root, results, job)
        guest = Guest(arguments, results, seconds)
        try:
            for _ in range(BOOTS - 1):
                if guest.wakes():
                    break
                guest.end()
                guest = Guest(arguments, results, seconds)
            yield guest
        finally:
            guest.end()


def end_with_parent(parent: int) -> Callable[[], None]:
    """Return a function that makes the kernel kill the child when this process ends."""
    prctl = ctypes.CDLL(None).prctl

    def prepare() -> None:
        if prctl(PR_SET_PDEATHSIG, signal.SIGKILL) != 0 or os.getppid() != parent:
            sys.exit(1)

    return prepare
