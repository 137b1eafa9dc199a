"""Folders of shares and mutexes: /run/catenary for a group of users, else one for each user.

/run/catenary belongs to root; one group may create files there (mode 3771: setgid, sticky).
`catenary doctor --apply` creates it. Without it, or outside of its group, a user's files are in
/dev/shm/catenary-UID, where only this user can list, create or lock. Others can pass through this
folder once one of its files grants them access.
"""

from __future__ import annotations

import fcntl
import os
import re
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from catenary.errors import ShareError
from catenary.share.process import is_running

GROUP_FOLDER = Path("/run/catenary")
USER_FOLDERS = Path("/dev/shm")
USER_IDS = Path("/proc/self/uid_map")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
STATE, SOCKET, MUTEX = "share", "socket", "mutex"  # a file's name begins with its kind
DRAFT = ".draft-"
DRAFT_AGE = 60.0  # [s] a draft exists for milliseconds
LOCK_PATIENCE = 2.0  # [s] a lock lasts as briefly
LOCK_PAUSE = 0.005


def file_name(kind: str, name: str) -> str:
    """Return the name of a file in a folder. Raises ValueError if `name` is invalid."""
    if not NAME.fullmatch(name):
        raise ValueError(
            f"share {name!r}: a name has up to 64 letters, digits, '.', '_' and '-', and begins "
            "with a letter or digit"
        )
    return f"{kind}-{name}"


def own_folder() -> Path:
    """Return the folder in which this user creates files."""
    if _is_group_folder() and os.access(GROUP_FOLDER, os.W_OK | os.X_OK, effective_ids=True):
        return GROUP_FOLDER
    return user_folder(os.geteuid())


def user_folder(uid: int) -> Path:
    """Return the folder of a user, named after the id outside of this user namespace.

    An ordinary user is root in the user namespace of a private network.
    """
    return USER_FOLDERS / f"catenary-{_outside(uid)}"


def prepare(folder: Path, mode: int) -> None:
    """Create this user's folder if it is missing, for files of `mode`.

    Raises ShareError if another user has created it: all users can write in /dev/shm.
    """
    if folder == GROUP_FOLDER:
        return
    with suppress(FileExistsError):
        folder.mkdir(0o700)
    status = folder.lstat()
    kind = "" if stat.S_ISDIR(status.st_mode) else ", and is not a folder"
    if kind or status.st_uid != os.geteuid():
        raise ShareError(
            f"{folder} belongs to user {status.st_uid} (you are {os.geteuid()}){kind}",
            hint="remove it as root; `sudo catenary doctor --apply` creates /run/catenary instead",
        )
    present = stat.S_IMODE(status.st_mode)
    wanted = 0o700 | present & 0o011 | _passage(mode)
    if present != wanted:
        folder.chmod(wanted)


def trusted_owners(uid: int | None) -> tuple[int, ...]:
    """Return the users whose files are opened: the one asked for, else this user and root."""
    return (os.geteuid(), 0) if uid is None else (uid,)


def find(file: str, uid: int | None) -> Path:
    """Return the path of an existing file of a trusted owner.

    Raises:
        FileNotFoundError: there is no such file.
        PermissionError: the folder of the user asked for cannot be entered.
        ShareError: there is one, and its owner is not trusted.
    """
    owners = trusted_owners(uid)
    group = [GROUP_FOLDER] if _is_group_folder() else []
    foreign: list[tuple[Path, int]] = []
    for folder in (*group, *map(user_folder, owners)):
        path = folder / file
        try:
            owner = path.lstat().st_uid
        except (FileNotFoundError, NotADirectoryError):
            continue
        except PermissionError:
            if uid is None or folder == GROUP_FOLDER:
                continue
            raise
        if owner in owners:
            return path
        foreign.append((path, owner))
    for path, owner in foreign:
        raise not_trusted(path, owner)
    raise FileNotFoundError(file)


def not_trusted(path: Path, owner: int) -> ShareError:
    return ShareError(
        f"{path} belongs to another user ({owner})",
        hint=f"uid={owner} opens it, if you trust that user",
    )


def names(uid: int | None) -> list[str]:
    """Return the names of all shares that `find` can see."""
    found: set[str] = set()
    for folder in (GROUP_FOLDER, *map(user_folder, trusted_owners(uid))):
        with suppress(OSError):
            found.update(path.name for path in folder.glob(f"{STATE}-*"))
    return sorted(name.removeprefix(f"{STATE}-") for name in found)


@contextmanager
def deciding(folder: Path) -> Iterator[None]:
    """Keep other processes from creating or removing files of this folder meanwhile.

    Raises ShareError if another process has the lock for longer than `LOCK_PATIENCE`.
    """
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW
    descriptor = os.open(folder, flags)
    try:
        _lock(descriptor, folder)
        yield
    finally:
        os.close(descriptor)


def draft_path(folder: Path) -> Path:
    """Return a name that readers do not open. A socket's path has at most 107 bytes."""
    return folder / f"{DRAFT}{os.getpid()}-{os.urandom(4).hex()}"


def remove_old_drafts(folder: Path) -> None:
    """Remove drafts of processes that were killed."""
    for path in folder.glob(f"{DRAFT}*"):
        pid = path.name.removeprefix(DRAFT).partition("-")[0]
        if not pid.isdecimal() or is_running(int(pid)):
            continue
        with suppress(OSError):  # another user's, or already removed
            if time.time() - path.lstat().st_mtime > DRAFT_AGE:
                path.unlink()


def _outside(uid: int) -> int:
    """Return a user's id in the parent of this user namespace: user_namespaces(7)."""
    with suppress(OSError):
        for line in USER_IDS.read_text().splitlines():
            inside, outside, count = map(int, line.split())
            if inside <= uid < inside + count:
                return outside + uid - inside
    return uid


def _is_group_folder() -> bool:
    """Return True if the folder belongs to root, is sticky, and not all users can write in it.

    Without the sticky bit, its group could rename and remove the files of others.
    """
    try:
        status = GROUP_FOLDER.lstat()
    except OSError:
        return False
    mode = status.st_mode
    closed = not mode & 0o002 and (mode & stat.S_ISVTX or not mode & 0o020)
    return stat.S_ISDIR(mode) and status.st_uid == 0 and bool(closed)


def _passage(mode: int) -> int:
    """Return the search permissions that files of `mode` need from their folder.

    All users pass: the group of a file can be another one than that of its folder (newgrp(1)).
    """
    return 0o011 if mode & 0o077 else 0


def _lock(descriptor: int, folder: Path) -> None:
    deadline = time.monotonic() + LOCK_PATIENCE
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError as error:
            if time.monotonic() >= deadline:
                holder = _lock_holder(os.fstat(descriptor).st_ino)
                raise ShareError(
                    f"{folder} has been locked for {LOCK_PATIENCE:g} s by {holder}",
                    hint="a lock lasts milliseconds: that process was stopped, or is hostile",
                ) from error
        time.sleep(LOCK_PAUSE)


def _lock_holder(inode: int) -> str:
    """Name the process that has a lock of this inode: proc_locks(5)."""
    pid = None
    with suppress(OSError):
        lines: Sequence[str] = Path("/proc/locks").read_text().splitlines()
        fields = [line.split() for line in lines if " FLOCK " in line and "->" not in line]
        pid = next((each[4] for each in fields if each[5].endswith(f":{inode}")), None)
    return f"process {pid}" if pid else "a process that is not visible here"
