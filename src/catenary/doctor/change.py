"""Changes by `doctor --apply`, and their reversal by `--undo`.

All changes are reversible: values in /proc or /sys, settings of the card's driver, and the folder
of shares. Each old value is saved on disk before the change. A reboot also undoes all changes.
Only `TARGETS` are ever written, whatever the state file contains.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import msgspec

from catenary.doctor import ethtool
from catenary.doctor.share_folder import read_folder, write_folder
from catenary.errors import CatenaryError

BOOT_ID = "/proc/sys/kernel/random/boot_id"
ETHTOOL = "ethtool:"  # prefix of NIC/SETTING, which is not a file
FOLDER = "folder:"  # prefix of the path of a folder
CPU = r"/sys/devices/system/cpu/cpu\d+"
NIC = r"[A-Za-z0-9][\w.:@-]*"
TARGETS = (
    rf"{CPU}/cpufreq/scaling_governor",
    rf"{CPU}/cpuidle/state\d+/disable",
    r"/sys/kernel/mm/transparent_hugepage/enabled",
    r"/proc/irq/\d+/smp_affinity_list",
    rf"/proc/sys/net/ipv6/conf/{NIC}/disable_ipv6",
    rf"/sys/class/net/{NIC}/(gro_flush_timeout|napi_defer_hard_irqs)",
    rf"{ETHTOOL}{NIC}/(eee|adaptive-rx|rx-usecs)",
    rf"{FOLDER}/run/catenary",
)


class StateError(CatenaryError):
    """The state file of changes cannot be written or read."""


@dataclass(frozen=True, slots=True)
class Change:
    """Change of a target to the value `after`.

    The target is a file, `ethtool:NIC/SETTING` or `folder:/run/catenary`.
    """

    target: str
    after: str

    def __str__(self) -> str:
        return f"{self.target} = {self.after}"


class Made(msgspec.Struct, frozen=True):
    """A change that was made, and the previous value."""

    target: str
    before: str
    after: str


class Noted(msgspec.Struct, frozen=True):
    """The content of the state file."""

    boot: str
    made: list[Made]


class Ground(Protocol):
    """Machine to change: this machine or a simulated one."""

    def read(self, target: str) -> str: ...
    def write(self, target: str, value: str) -> None: ...


@dataclass(frozen=True, slots=True)
class MachineGround:
    """This machine; `root` is the root folder of its files.

    Both methods raise OSError if the access is refused.
    """

    root: Path = Path("/")

    def read(self, target: str) -> str:
        check_target(target)
        if target.startswith(ETHTOOL):
            return str(ethtool.read_setting(*split(target)))
        if target.startswith(FOLDER):
            return read_folder(self.root / target.removeprefix(FOLDER).lstrip("/"))
        return chosen((self.root / target.lstrip("/")).read_text().strip())

    def write(self, target: str, value: str) -> None:
        check_target(target)
        if target.startswith(ETHTOOL):
            ethtool.write_setting(*split(target), whole_number(value, target))
        elif target.startswith(FOLDER):
            write_folder(self.root / target.removeprefix(FOLDER).lstrip("/"), value)
        else:
            (self.root / target.lstrip("/")).write_text(value)


def check_target(target: str) -> None:
    """Raise OSError unless the doctor may read and change this target."""
    if not any(re.fullmatch(known, target) for known in TARGETS):
        raise OSError(errno.EPERM, "not a setting that the doctor changes", target)


def split(target: str) -> tuple[str, str]:
    name, _, setting = target.removeprefix(ETHTOOL).rpartition("/")
    return name, setting


def whole_number(value: str, target: str) -> int:
    """Return the value as a number. Raises OSError if it is invalid, as a driver would."""
    if not re.fullmatch(r"\d{1,10}", value, re.ASCII):
        raise OSError(errno.EINVAL, f"{value!r} is not a number", target)
    return int(value)


def chosen(text: str) -> str:
    """Return the word in brackets if the text lists all possible values; otherwise the text."""
    words = [word for word in text.split() if word.startswith("[") and word.endswith("]")]
    return words[0][1:-1] if words else text


class HostState:
    """Owner of the state file, which contains the changes since the machine was started."""

    def __init__(self, path: Path, boot: str) -> None:
        self.path = path
        self.boot = boot

    def load(self) -> list[Made]:
        """Return the changes, oldest first; empty if the machine was rebooted since then.

        Raises StateError if the file is damaged, or if another user could have written it.
        """
        try:
            content = self._read()
            noted = msgspec.json.decode(content, type=Noted)
        except FileNotFoundError:
            return []
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise StateError(
                f"{self.path} cannot be read: {error}",
                hint="reboot to undo all changes by --apply, then delete the file",
            ) from error
        return noted.made if noted.boot == self.boot else []

    def _read(self) -> bytes:
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        with open(os.open(self.path, flags), "rb") as file:
            status = os.fstat(file.fileno())
            if status.st_uid != os.geteuid() or status.st_mode & 0o022:
                raise StateError(
                    f"{self.path} belongs to user {status.st_uid} (mode "
                    f"{status.st_mode & 0o7777:o}); its content is not trusted",
                    hint="run --undo as the user who ran --apply, or reboot to undo all changes",
                )
            return file.read()

    def save(self, made: Sequence[Made]) -> None:
        """Write the file atomically. Raises StateError if the disk is full or access is denied."""
        text = msgspec.json.format(msgspec.json.encode(Noted(self.boot, list(made))), indent=2)
        new = self.path.with_suffix(".new")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):
                new.unlink()
            # O_EXCL does not follow a link that another user may have created.
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            with open(os.open(new, flags, 0o600), "wb") as file:
                file.write(text + b"\n")
                file.flush()
                os.fsync(file.fileno())
            new.replace(self.path)
        except OSError as error:
            raise StateError(
                f"{self.path} cannot be written ({error.strerror}); no setting is changed if its "
                "old value cannot be saved",
                hint="set $XDG_STATE_HOME to a writable folder",
            ) from error

    def forget(self) -> None:
        self.path.unlink(missing_ok=True)


def open_state() -> HostState:
    """Return the state file: in $XDG_STATE_HOME if set, else in /run (root) or ~/.local/state.

    It is not in /run/catenary, where a group of users may create files.
    """
    boot = Path(BOOT_ID).read_text().strip()
    folder = os.environ.get("XDG_STATE_HOME")
    if not folder and os.geteuid() == 0:
        return HostState(Path("/run/catenary-doctor.json"), boot)
    return HostState(
        Path(folder or Path.home() / ".local" / "state") / "catenary" / "doctor.json", boot
    )


def apply(changes: Sequence[Change], ground: Ground, state: HostState) -> Iterator[str]:
    """Make the changes one by one, and yield a line with the result of each.

    Args:
        changes: Changes to make.
        ground: Machine to change.
        state: State file, which receives the old values before each change.

    Raises:
        StateError: The state file cannot be read or written.
    """
    made = state.load()
    for change in changes:
        try:
            before = ground.read(change.target)
            if before == change.after:
                yield f"already set: {change}"
                continue
            state.save([*made, Made(change.target, before, change.after)])
            ground.write(change.target, change.after)
        except OSError as error:
            state.save(made)
            yield f"REFUSED ({error.strerror}): {change}"
            continue
        made.append(Made(change.target, before, change.after))
        yield f"done: {change} (was {before})"


def undo(ground: Ground, state: HostState) -> Iterator[str]:
    """Undo all changes in reverse order, and yield a line with the result of each.

    A value that was changed again since then is kept. Refused changes stay in the state file.

    Args:
        ground: Machine to change.
        state: State file with the changes.

    Raises:
        StateError: The state file cannot be read or written.
    """
    left: list[Made] = []
    for made in reversed(state.load()):
        try:
            if ground.read(made.target) != made.after:
                yield f"not undone, because its value was changed again: {made.target}"
                continue
            ground.write(made.target, made.before)
        except OSError as error:
            left.insert(0, made)
            yield f"REFUSED ({error.strerror}): {made.target} = {made.before}"
            continue
        yield f"undone: {made.target} = {made.before}"
    if left:
        state.save(left)
    else:
        state.forget()
