"""Unique names of shares, whose files are removed after the test."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catenary.share.folder import own_folder


@contextmanager
def own_name(what: str) -> Iterator[str]:
    name = f"test-{os.getpid()}-{what}-{os.urandom(3).hex()}"
    try:
        yield name
    finally:
        for path in files_of(name):
            path.unlink()


def files_of(name: str) -> list[Path]:
    """Return all files of shares and mutexes whose names begin with `name`, and drafts."""
    folder = own_folder()
    return [*folder.glob(f"*-{name}*"), *folder.glob(f".draft-{os.getpid()}-*")]


def state_file(name: str) -> Path:
    return own_folder() / f"share-{name}"


def mutex_file(name: str) -> Path:
    """Return the path of a mutex, and create its folder."""
    own_folder().mkdir(0o700, exist_ok=True)
    return own_folder() / f"mutex-{name}"
