"""Messages and exit statuses for exceptions."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

from catenary.cli.text import escaped
from catenary.errors import CatenaryError

FAILED = 1
USAGE = 2
BROKEN_PIPE = 141  # 128 + SIGPIPE
FILE_HINTS: Mapping[type[OSError], str] = {
    FileExistsError: "a folder is needed, but a file with that name exists",
    NotADirectoryError: "a part of the path is a file",
    IsADirectoryError: "a file is needed, but this is a folder",
    PermissionError: "check its owner and permissions: ls -l",
}


class UsageError(Exception):
    """An invalid command line, detected after argument parsing."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


def report(error: Exception, program: str = "catenary") -> int:
    """Print an error and its hint to stderr, and return the exit status."""
    message, hint = describe(error)
    print(f"{program}: {message}", file=sys.stderr)
    if hint:
        print(f"  hint: {hint}", file=sys.stderr)
    return USAGE if isinstance(error, UsageError) else FAILED


def describe(error: Exception) -> tuple[str, str]:
    """Return the message and the hint for an error, each on one line."""
    if isinstance(error, CatenaryError):
        return one_line(error.message), one_line(error.hint)
    if isinstance(error, UsageError):
        return one_line(str(error)), error.hint
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}", FILE_HINTS.get(type(error), "")
    if isinstance(error, ValueError | OSError):
        return one_line(str(error)), ""
    if isinstance(error, ImportError) and (error.name or "").startswith("catenary."):
        return one_line(
            str(error)
        ), "the compiled modules do not match the Python code: run `make build`"
    kind = type(error).__name__
    return (
        f"internal error: {kind}: {one_line(str(error))}",
        "report this error with the traceback that --debug shows",
    )


def one_line(text: str) -> str:
    """Return the text on one line, with unprintable characters escaped."""
    return escaped(" ".join(text.split()))


def with_hint(error: CatenaryError) -> str:
    """Return the message and the hint of an error that does not end the command."""
    hint = f"\n  hint: {one_line(error.hint)}" if error.hint else ""
    return f"{one_line(error.message)}{hint}"


def silence_stdout() -> int:
    """Redirect stdout to /dev/null after its reader has closed (`catenary scan | head -1`).

    This prevents an error message when the interpreter flushes stdout at exit. Return the exit
    status.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return BROKEN_PIPE
