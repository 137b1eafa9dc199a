"""Folders of shares and mutexes: /run/catenary for a group of users, or one folder for each user.

/run/catenary belongs to root, and one group can create files there (mode 3771: setgid, sticky).
`catenary doctor --apply` creates it. Without it, or outside of its group, the files of a user are
in /dev/shm/catenary-UID. Only this user can list, create or lock files there. Other users can
traverse the folder as soon as one of its files grants them access.
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
STATE, SOCKET, MUTEX = "share", "socket", "mutex"  # prefixes of file names
DRAFT = ".draft-"
DRAFT_AGE = 60.0  # [s]; a draft normally exists for milliseconds
LOCK_TIMEOUT = 2.0  # [s]; a lock is normally held for milliseconds
LOCK_PAUSE = 0.005  # [s] between two attempts


def file_name(kind: str, name: str) -> str:
    """Return the file name of a share, socket or mutex.

    Args:
        kind: STATE, SOCKET or MUTEX.
        name: name that the user has chosen.

    Raises:
        ValueError: the name is invalid.
    """
    if not NAME.fullmatch(name):
        raise ValueError(
            f"invalid name {name!r}: use 1 to 64 letters, digits, '.', '_' or '-', and begin with "
            "a letter or digit"
        )
    return f"{kind}-{name}"


def own_folder() -> Path:
    """Return the folder in which this user creates files."""
    if _is_group_folder() and os.access(GROUP_FOLDER, os.W_OK | os.X_OK, effective_ids=True):
        return GROUP_FOLDER
    return user_folder(os.geteuid())


def user_folder(uid: int) -> Path:
    """Return the folder of a user. Its name contains the user id outside of this user namespace.

    In the user namespace of a private network, an ordinary user appears as root.
    """
    return USER_FOLDERS / f"catenary-{_outside(uid)}"


def prepare(folder: Path, mode: int) -> None:
    """Create the folder of this user if it is missing, and set its mode.

    A no-op for /run/catenary.

    Args:
        folder: the folder.
        mode: mode of the files to be created in it, which determines the mode of the folder.

    Raises:
        ShareError: the path is not a folder, or another user has created it; all users can write
            to /dev/shm.
    """
    if folder == GROUP_FOLDER:
        return
    with suppress(FileExistsError):
        folder.mkdir(0o700)
    status = folder.lstat()
    kind = "" if stat.S_ISDIR(status.st_mode) else " and is not a folder"
    if kind or status.st_uid != os.geteuid():
        raise ShareError(
            f"{folder} belongs to user {status.st_uid} (you are user {os.geteuid()}){kind}",
            hint="remove it as root, or use /run/catenary: `sudo catenary doctor --apply`",
        )
    present = stat.S_IMODE(status.st_mode)
    required = 0o700 | present & 0o011 | _search_permissions(mode)
    if present != required:
        folder.chmod(required)


def trusted_owners(uid: int | None) -> tuple[int, ...]:
    """Return the users whose files may be opened: `uid`; if it is None, this user and root."""
    return (os.geteuid(), 0) if uid is None else (uid,)


def find(file: str, uid: int | None) -> Path:
    """Return the path of an existing file that a trusted user owns.

    Args:
        file: name of the file.
        uid: owner of the file; None: this user or root.

    Raises:
        FileNotFoundError: no such file exists.
        PermissionError: the folder of user `uid` is not accessible.
        ShareError: the file exists, but its owner is not trusted.
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
    """Return the error for a file of a user that is not trusted."""
    return ShareError(
        f"{path} belongs to another user ({owner})",
        hint=f"pass uid={owner} if you trust that user",
    )


def names(uid: int | None) -> list[str]:
    """Return the names of the shares in all folders that `find` searches."""
    found: set[str] = set()
    for folder in (GROUP_FOLDER, *map(user_folder, trusted_owners(uid))):
        with suppress(OSError):
            found.update(path.name for path in folder.glob(f"{STATE}-*"))
    return sorted(name.removeprefix(f"{STATE}-") for name in found)


@contextmanager
def deciding(folder: Path) -> Iterator[None]:
    """Lock the folder, so that only one process at a time publishes or removes a share in it.

    Raises ShareError if another process holds the lock for longer than `LOCK_TIMEOUT`.
    """
    flags = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | os.O_NOFOLLOW
    descriptor = os.open(folder, flags)
    try:
        _lock(descriptor, folder)
        yield
    finally:
        os.close(descriptor)


def draft_path(folder: Path) -> Path:
    """Return a new, short path that readers ignore. A socket path has at most 107 bytes."""
    return folder / f"{DRAFT}{os.getpid()}-{os.urandom(4).hex()}"


def remove_old_drafts(folder: Path) -> None:
    """Remove drafts of processes that were killed."""
    for path in folder.glob(f"{DRAFT}*"):
        pid = path.name.removeprefix(DRAFT).partition("-")[0]
        if not pid.isdecimal() or is_running(int(pid)):
            continue
        with suppress(OSError):  # it belongs to another user, or was already removed
            if time.time() - path.lstat().st_mtime > DRAFT_AGE:
                path.unlink()


def _outside(uid: int) -> int:
    """Return the id of a user in the parent of this user namespace, user_namespaces(7)."""
    with suppress(OSError):
        for line in USER_IDS.read_text().splitlines():
            inside, outside, count = map(int, line.split())
            if inside <= uid < inside + count:
                return outside + uid - inside
    return uid


def _is_group_folder() -> bool:
    """Return True if /run/catenary belongs to root and has safe permissions.

    Not all users may write to it. If its group may, it must be sticky. Otherwise, members of the
    group could rename and remove the files of others.
    """
    try:
        status = GROUP_FOLDER.lstat()
    except OSError:
        return False
    mode = status.st_mode
    closed = not mode & 0o002 and (mode & stat.S_ISVTX or not mode & 0o020)
    return stat.S_ISDIR(mode) and status.st_uid == 0 and bool(closed)


def _search_permissions(mode: int) -> int:
    """Return the search permissions that a folder needs for files of `mode`.

    If other users may access the files, all users may traverse the folder, because file and folder
    can have different groups (newgrp(1)).
    """
    return 0o011 if mode & 0o077 else 0


def _lock(descriptor: int, folder: Path) -> None:
    deadline = time.monotonic() + LOCK_TIMEOUT
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError as error:
            if time.monotonic() >= deadline:
                holder = _lock_holder(os.fstat(descriptor).st_ino)
                raise ShareError(
                    f"{folder} has been locked for {LOCK_TIMEOUT:g} s by {holder}",
                    hint="the lock is normally held for milliseconds: continue that process if it "
                    "was stopped, or end it",
                ) from error
        time.sleep(LOCK_PAUSE)


def _lock_holder(inode: int) -> str:
    """Return a description of the process that holds a lock on this inode, proc_locks(5)."""
    pid = None
    with suppress(OSError):
        lines: Sequence[str] = Path("/proc/locks").read_text().splitlines()
        fields = [line.split() for line in lines if " FLOCK " in line and "->" not in line]
        pid = next((each[4] for each in fields if each[5].endswith(f":{inode}")), None)
    return f"process {pid}" if pid else "a process that is not visible here"
