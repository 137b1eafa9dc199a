"""Changes of `--apply`, and how `--undo` takes them back.

Only what is reversible: a value of /proc or /sys, or a setting of the card's driver, that is read
before it is written. What was there is on disk before anything is changed. A reboot undoes all too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from catenary.doctor import ethtool
from catenary.errors import CatenaryError

BOOT_ID = "/proc/sys/kernel/random/boot_id"
ETHTOOL = "ethtool:"  # before NIC/SETTING, where a change is no file's


class StateError(CatenaryError):
    """What was changed cannot be noted down, or what is noted down cannot be read."""


@dataclass(frozen=True, slots=True)
class Change:
    """target: a file, or `ethtool:eth0/rx-usecs`. after: what it is to hold."""

    target: str
    after: str

    def __str__(self) -> str:
        return f"{self.target} = {self.after}"


@dataclass(frozen=True, slots=True)
class Made:
    """A change that was made, and what was there before."""

    target: str
    before: str
    after: str


class Ground(Protocol):
    """What changes are made to."""

    def read(self, target: str) -> str: ...
    def write(self, target: str, value: str) -> None: ...


@dataclass(frozen=True, slots=True)
class MachineGround:
    """This machine; `root` is another place for its files. OSError: refused."""

    root: Path = Path("/")

    def read(self, target: str) -> str:
        if target.startswith(ETHTOOL):
            return str(ethtool.read_setting(*split(target)))
        return chosen((self.root / target.lstrip("/")).read_text().strip())

    def write(self, target: str, value: str) -> None:
        if target.startswith(ETHTOOL):
            ethtool.write_setting(*split(target), int(value))
        else:
            (self.root / target.lstrip("/")).write_text(value)


def split(target: str) -> tuple[str, str]:
    name, _, setting = target.removeprefix(ETHTOOL).rpartition("/")
    return name, setting


def chosen(text: str) -> str:
    """The word in brackets, where a file lists all that it could hold."""
    words = [word for word in text.split() if word.startswith("[") and word.endswith("]")]
    return words[0][1:-1] if words else text


class State:
    """Owns the file of what was changed since the machine was started."""

    def __init__(self, path: Path, boot: str) -> None:
        self.path = path
        self.boot = boot

    def load(self) -> list[Made]:
        """Oldest first; none where the machine was started anew since. StateError: no such file's
        contents."""
        try:
            state = json.loads(self.path.read_text())
            return [Made(**made) for made in state["made"]] if state["boot"] == self.boot else []
        except FileNotFoundError:
            return []
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StateError(
                f"{self.path} does not tell what was changed: {error}",
                hint="a reboot undoes everything that --apply did; then delete the file",
            ) from error

    def save(self, made: Sequence[Made]) -> None:
        """Whole or not at all. StateError: a full disk, or no permission."""
        text = json.dumps({"boot": self.boot, "made": [asdict(one) for one in made]}, indent=2)
        new = self.path.with_suffix(".new")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with new.open("w") as file:
                file.write(text + "\n")
                file.flush()
                os.fsync(file.fileno())
            new.replace(self.path)
        except OSError as error:
            raise StateError(
                f"{self.path} cannot be written ({error.strerror}), so nothing is changed that "
                "could not be undone",
                hint="$XDG_STATE_HOME names another folder",
            ) from error

    def forget(self) -> None:
        self.path.unlink(missing_ok=True)


def open_state() -> State:
    """Below $XDG_STATE_HOME where that is set; else /run for root, ~/.local/state for others."""
    folder = os.environ.get("XDG_STATE_HOME")
    if not folder:
        folder = "/run" if os.geteuid() == 0 else str(Path.home() / ".local" / "state")
    return State(Path(folder) / "catenary" / "doctor.json", Path(BOOT_ID).read_text().strip())


def apply(changes: Sequence[Change], ground: Ground, state: State) -> Iterator[str]:
    """Makes them one by one, and says of each what became of it."""
    made = state.load()
    for change in changes:
        try:
            before = ground.read(change.target)
            if before == change.after:
                yield f"as it should be already: {change}"
                continue
            state.save([*made, Made(change.target, before, change.after)])
            ground.write(change.target, change.after)
        except OSError as error:
            state.save(made)
            yield f"REFUSED ({error.strerror}): {change}"
            continue
        made.append(Made(change.target, before, change.after))
        yield f"done: {change} (was {before})"


def undo(ground: Ground, state: State) -> Iterator[str]:
    """Takes all back, the last first. What somebody changed since is left as it is; what is refused
    stays noted."""
    left: list[Made] = []
    for made in reversed(state.load()):
        try:
            if ground.read(made.target) != made.after:
                yield f"left, since it was changed by somebody else: {made.target}"
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
