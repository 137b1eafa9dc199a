"""Keys of teleoperation links: 32 random bytes, which both sides share.

python -m catenary.teleoperation.key arm.key    # writes a new key, mode 0600
"""

from __future__ import annotations

import argparse
import errno
import os
import secrets
import stat
import sys
from pathlib import Path

from catenary.errors import CatenaryError, ConfigurationError
from catenary.teleoperation.packet import KEY_BYTES

VARIABLE = "CATENARY_TELEOPERATION_KEY"
SIZE_MAX = 4096  # bytes of a key file, more than any valid one
OPENING = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC  # a FIFO does not block
MAKE = "python -m catenary.teleoperation.key FILE"


def make_key(path: Path | str) -> bytes:
    """Write a new random key to a file of mode 0600, and return it.

    Raises FileExistsError if the file exists.
    """
    key = secrets.token_bytes(KEY_BYTES)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(f"{key.hex()}\n")
    return key


def read_key(path: Path | str | None = None) -> bytes:
    """Return the key in a file, as 64 hexadecimal digits.

    Args:
        path: the file; None: the digits are in the environment, `CATENARY_TELEOPERATION_KEY`.

    Raises:
        ConfigurationError: the key is absent or invalid, or the file is a link, a device, too
            large, of another user, or open to other users.
    """
    if path is None:
        if VARIABLE not in os.environ:
            raise ConfigurationError(
                f"the environment variable {VARIABLE} is not set",
                hint=f"set it to the digits in a key file, or give its path; make one: {MAKE}",
            )
        return _parse(os.environ[VARIABLE], f"the environment variable {VARIABLE}")
    try:
        descriptor = os.open(path, OPENING)
    except OSError as error:
        is_link = error.errno == errno.ELOOP
        raise ConfigurationError(
            f"cannot read the key {path}: {'symbolic link' if is_link else error.strerror}",
            hint="name the file itself" if is_link else f"make one: {MAKE}",
        ) from error
    try:
        _check(path, os.fstat(descriptor))
        return _parse(os.read(descriptor, SIZE_MAX).decode("ascii", "replace"), f"the key {path}")
    finally:
        os.close(descriptor)


def _check(path: Path | str, status: os.stat_result) -> None:
    """Raise ConfigurationError unless only the user of this program can use a file."""
    mode, user = stat.S_IMODE(status.st_mode), os.geteuid()
    if not stat.S_ISREG(status.st_mode):
        raise ConfigurationError(
            f"the key {path} is not a file", hint=f"name the file of the key; make one: {MAKE}"
        )
    if status.st_size > SIZE_MAX:
        raise ConfigurationError(
            f"the key {path} has {status.st_size} bytes, and a key file {2 * KEY_BYTES + 1}",
            hint=f"name the file of the key; make one: {MAKE}",
        )
    if status.st_uid != user:
        raise ConfigurationError(
            f"the key {path} belongs to user {status.st_uid}, and this program runs as user {user}",
            hint=f"sudo chown {user} {path}, or start the program as the owner",
        )
    if mode & 0o077:
        raise ConfigurationError(
            f"the key {path} has mode {mode:o}, so that other users can read or replace it",
            hint=f"chmod 600 {path}; if others may have read it, make a new key: {MAKE}",
        )


def _parse(text: str, place: str) -> bytes:
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise ConfigurationError(
            f"{place} does not have {2 * KEY_BYTES} hexadecimal digits", hint=f"make one: {MAKE}"
        )
    return key


def main() -> int:
    """Write a new key to the file that the command line names."""
    parser = argparse.ArgumentParser(
        prog="python -m catenary.teleoperation.key",
        description="Write a new random key of a teleoperation link to a file of mode 0600. "
        "Copy the file to the other machine over a protected connection, such as scp.",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    path = parser.parse_args().file
    try:
        make_key(path)
    except FileExistsError:
        raise ConfigurationError(
            f"{path} exists", hint="remove it first if the old key is no longer used"
        ) from None
    except OSError as error:
        raise ConfigurationError(
            f"cannot write {path}: {error.strerror}",
            hint="name a file in a folder that exists and that you can write",
        ) from error
    print(f"wrote {path}; copy it to the other machine with scp -p")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except CatenaryError as error:
        sys.exit(f"error: {error}")
