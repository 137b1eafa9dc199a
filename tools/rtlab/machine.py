"""The machine of the lab: QEMU with one processor whose clock counts its instructions."""

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
# On a busy host one kernel in five dies in its first steps, before it says anything (QEMU 7.2).
BOOT_SECONDS, BOOTS = 120.0, 4  # of the host's, until the guest's first word; at most so many
PR_SET_PDEATHSIG = 1  # linux/prctl.h
COMMAND_LINE_SIZE = 2048  # of the kernel on x86; what is beyond is cut off
END_SECONDS = 30.0  # from a guest's last line to the end of QEMU
KERNEL_ARGUMENTS = (
    *("console=ttyS0", "quiet", "loglevel=3", "panic=-1", "rdinit=/init"),
    *("nokaslr", "norandmaps", "random.trust_cpu=on"),  # one run is to be as another
    *("tsc=reliable", "mitigations=off"),
)


def program() -> str:
    """LabError: it is not installed."""
    path = shutil.which(PROGRAM)
    if path is None:
        raise LabError(f"there is no {PROGRAM}: `sudo apt-get install qemu-system-x86`")
    return path


def version() -> str:
    done = subprocess.run([program(), "--version"], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0].removeprefix("QEMU emulator version ")


def command(kernel: Kernel, root: Path, results: Path, job: Mapping[str, object]) -> list[str]:
    """`sleep=off`: where nothing runs in the guest, its clock goes on at once to the next timer.
    All of its memory is there before it starts: a disk would answer in the host's time. LabError:
    the job is too long."""
    encoded = base64.b64encode(json.dumps(job).encode()).decode()
    said = " ".join((*KERNEL_ARGUMENTS, f"RTLAB_JOB={encoded}"))
    if len(said) >= COMMAND_LINE_SIZE:
        raise LabError(
            f"the guest is told its work in {len(said)} characters, and understands"
            f" {COMMAND_LINE_SIZE - 1}: fewer --options, or a shorter path of the working copy"
        )
    return [
        program(),
        *("-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
        *("-accel", "tcg", "-icount", f"shift={SHIFT},sleep=off", "-rtc", "clock=vm"),
        *("-cpu", "max", "-smp", "1", "-m", str(MEMORY_MB), "-seed", "1"),
        *("-kernel", str(kernel.image), "-initrd", str(root)),
        *("-append", said),
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
        with self.errors.open("wb") as errors:  # a pipe that nobody reads would stop it when full
            self.process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                start_new_session=True,  # a Ctrl-C in the terminal is ours: we end it
                preexec_fn=end_with_parent(os.getpid()),
            )

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.started

    def wakes(self) -> bool:
        """Whether it prints something, as the guest's first process does, or `lines` will judge."""
        if self.limit <= BOOT_SECONDS:
            return True
        return bool(select.select([self.process.stdout], [], [], BOOT_SECONDS)[0])

    def lines(self) -> Iterator[str]:
        """What it prints, until it turns itself off. LabError: the deadline."""
        unread = b""
        while data := self._read():
            *whole, unread = re.split(rb"\r\x1b\[K|\r*\n", unread + data)  # or a line written over
            yield from (line.decode(errors="replace") for line in whole)
        if unread:
            yield unread.decode(errors="replace")

    def _read(self) -> bytes:
        assert self.process.stdout is not None
        left = self.limit - self.seconds
        if left <= 0 or not select.select([self.process.stdout], [], [], left)[0]:
            raise LabError(f"not done within {self.limit / 60:.1f} minutes: --minutes gives more")
        return os.read(self.process.stdout.fileno(), 65536)

    def answer(self) -> dict[str, Any]:
        """What the guest wrote at its end. LabError: nothing, or that it failed."""
        try:
            self.process.communicate(timeout=END_SECONDS)
        except subprocess.TimeoutExpired:
            raise LabError(f"QEMU did not end within {END_SECONDS:.0f} s of its guest") from None
        if self.process.returncode != 0:
            errors = self.errors.read_text(errors="replace")
            said = errors.strip().splitlines() or ["it said nothing"]
            raise LabError(f"QEMU ended with status {self.process.returncode}: {said[0]}")
        return understood(self.results.read_text(errors="replace"))

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


def understood(said: str) -> dict[str, Any]:
    """One line of JSON. LabError: it is none, or the command failed."""
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
    """A guest for as long as the block lasts, and no longer."""
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
    """Has the kernel kill the child when we end, however that is."""
    prctl = ctypes.CDLL(None).prctl

    def prepare() -> None:
        if prctl(PR_SET_PDEATHSIG, signal.SIGKILL) != 0 or os.getppid() != parent:
            sys.exit(1)

    return prepare
