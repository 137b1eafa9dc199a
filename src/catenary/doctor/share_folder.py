"""State of the folder in which a group of users shares memory, written as text.

"absent"                    the folder does not exist
"3771 root:catenary"        permissions, owner, group
"""

from __future__ import annotations

import errno
import grp
import os
import pwd
import shutil
import stat
from contextlib import suppress
from pathlib import Path

ABSENT = "absent"
MODE = 0o3771  # setgid: files get the folder's group; sticky: only owners can remove files


def expected(group: str) -> str:
    return f"{MODE:o} root:{group}"


def read_folder(path: Path) -> str:
    try:
        status = path.lstat()
    except FileNotFoundError:
        return ABSENT
    if not stat.S_ISDIR(status.st_mode):
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path))
    owner, group = str(status.st_uid), str(status.st_gid)
    with suppress(KeyError):
        owner = pwd.getpwuid(status.st_uid).pw_name
    with suppress(KeyError):
        group = grp.getgrgid(status.st_gid).gr_name
    return f"{stat.S_IMODE(status.st_mode):o} {owner}:{group}"


def write_folder(path: Path, value: str) -> None:
    """Create, change or remove the folder. Raises OSError if the value is invalid or refused."""
    if value == ABSENT:
        path.rmdir()  # fails while the folder contains shares
        return
    try:
        mode, names = value.split(" ")
        owner, group = names.split(":")
        permissions = int(mode, 8)
    except ValueError:
        raise OSError(errno.EINVAL, f"invalid folder state {value!r}", str(path)) from None
    with suppress(FileExistsError):
        path.mkdir(0o700)
    try:
        shutil.chown(path, owner, group)
    except LookupError as error:
        raise OSError(errno.EINVAL, str(error), str(path)) from error
    path.chmod(permissions)  # after chown, which clears setgid
