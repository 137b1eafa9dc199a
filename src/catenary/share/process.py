"""Identity of a process, distinct from that of a later process with the same PID."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
STATE, START_TIME = 0, 19  # fields of /proc/PID/stat after the command, proc(5)
DEAD = ("Z", "X")


class Process(msgspec.Struct, frozen=True):
    """A process on this machine."""

    pid: int
    start_time: int  # clock ticks after the boot
    boot_id: str
    command: str

    @property
    def is_alive(self) -> bool:
        """True if this process still runs. Always False in another PID namespace."""
        return _start_time(self.pid) == self.start_time and self.boot_id == _boot_id()

    def __str__(self) -> str:
        """Return the PID and the command, with control characters replaced by '?'."""
        command = "".join(c if c.isprintable() else "?" for c in self.command)
        return f"process {self.pid} ({command})" if command else f"process {self.pid}"


def is_running(pid: int) -> bool:
    """Return True if a process with this PID runs."""
    return _start_time(pid) is not None


def this_process() -> Process:
    """Return the identity of the calling process."""
    pid = os.getpid()
    return Process(pid, _start_time(pid) or 0, _boot_id(), command_of(pid))


def _start_time(pid: int) -> int | None:
    """Return the start time of a process; None if it does not exist or is a zombie."""
    try:
        # A process chooses its name, which need not be UTF-8: prctl(2), PR_SET_NAME.
        stat = Path(f"/proc/{pid}/stat").read_text(errors="replace")
    except OSError:
        return None
    fields = stat.rpartition(")")[2].split()
    return None if fields[STATE] in DEAD else int(fields[START_TIME])


def _boot_id() -> str:
    try:
        return BOOT_ID.read_text().strip()
    except OSError:  # /proc is incomplete in some containers
        return ""


def command_of(pid: int) -> str:
    """Return the name of the program; for Python, that of the script or module."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return ""
    if "python" not in words[0]:
        return Path(words[0]).name
    for word, following in zip(words[1:], [*words[2:], ""], strict=True):
        if word == "-c":
            break
        if word == "-m":
            return following
        if word and not word.startswith("-"):
            return Path(word).name
    return "python"
