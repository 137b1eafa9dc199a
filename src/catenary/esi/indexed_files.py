"""XML files of a library with their index, which follows changes of the files."""

from __future__ import annotations

import hashlib
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from catenary.errors import EsiError
from catenary.esi.index import index_file
from catenary.esi.record import FileIndex, FileState, Record
from catenary.esi.source import EsiWarning, Source
from catenary.esi.sources import Found, Listing, list_files, locked
from catenary.esi.store import MEMORY, IndexStore, copy_in_memory

Sources = Callable[[], list[Path]]


class Changes(NamedTuple):
    """Differences between the files and their index."""

    changed: list[tuple[Found, FileState]]  # new content
    moved: list[tuple[Found, FileState]]  # same content, but another time or source
    gone: list[str]
    problems: list[str]

    @property
    def any(self) -> bool:
        """True if the index has to be written."""
        return bool(self.changed or self.moved or self.gone)


class IndexedFiles:
    """Files of a library. It owns the index of these files.

    A file is read again if its size or time of change differs, and its hash too. An edit that
    keeps size and time is noticed only by `refresh(all_hashes=True)`.
    """

    def __init__(self, sources: Sources, index: str, lock: Path | None) -> None:
        self._sources = sources
        self._lock = lock
        with _index_errors(index):
            self._store = _open_store(index)
        if self._store.path == MEMORY:
            self._lock = None  # the index of this process alone
        self.problems: tuple[str, ...] = ()

    def close(self) -> None:
        """Close the index."""
        self._store.close()

    def refresh(self, *, all_hashes: bool = False) -> None:
        """Bring the index up to date with the files.

        Args:
            all_hashes: True to compare the hash of every file, also if size and time are equal.

        Raises:
            EsiError: The index cannot be written, or a folder has too many files.
        """
        with _index_errors(self._store.path):
            changes = self._changes(list_files(self._sources()), all_hashes)
            if changes.any:
                with locked(self._lock):  # another process may have done it, or added a file
                    changes = self._changes(list_files(self._sources()), all_hashes)
                    self._update(changes)
        self.problems = tuple(changes.problems)

    def _changes(self, listing: Listing, all_hashes: bool) -> Changes:
        known = self._store.states()
        changes = Changes([], [], [], list(listing.problems))
        for found in listing.files.values():
            try:
                self._compare(found, known.get(found.path), all_hashes, changes)
            except OSError as error:
                changes.problems.append(f"{found.path}: {error.strerror}")
                if found.path in known:
                    changes.gone.append(found.path)
        changes.gone.extend(known.keys() - listing.files.keys())
        return changes

    def _compare(
        self, found: Found, known: tuple[FileState, Found] | None, hashed: bool, changes: Changes
    ) -> None:
        status = os.stat(found.path)
        old = known[0] if known is not None else FileState(-1, -1, "")
        same = (status.st_size, status.st_mtime_ns) == (old.size, old.mtime_ns)
        if same and not hashed and known is not None and known[1] == found:
            if not os.access(found.path, os.R_OK):
                raise PermissionError(13, "Permission denied", found.path)
            return
        digest = old.digest if same and not hashed else _digest(found.path)
        state = FileState(status.st_size, status.st_mtime_ns, digest)
        if digest != old.digest:
            changes.changed.append((found, state))
        elif known != (state, found):
            changes.moved.append((found, state))

    def _update(self, changes: Changes) -> None:
        indexed = [
            (found, state, indexed_or_warned(found.path)) for found, state in changes.changed
        ]
        self._store.write(indexed, changes.moved, changes.gone)

    def records(self, where: str = "1", *values: int | str) -> list[Record]:
        """Return entries, the preferred ones first; see `IndexStore.records`.

        Args:
            where: Condition in SQL.
            values: Values of the condition.
        """
        with _index_errors(self._store.path):
            return self._store.records(where, *values)

    def file(self, path: str) -> FileIndex | None:
        """Return what the devices of a file share; None if the file is not indexed."""
        with _index_errors(self._store.path):
            return self._store.file(path)

    def files(self) -> list[FileIndex]:
        """Return all files, without their entries, in the order of their paths."""
        with _index_errors(self._store.path):
            found = [self._store.file(path) for path in sorted(self._store.states())]
        return [each for each in found if each is not None]


def indexed_or_warned(path: str) -> FileIndex:
    """Return the index of a file. A file that cannot be read has a warning and no entries."""
    try:
        return index_file(path)
    except EsiError as error:
        source = Source(path, error.line or 1)
        return FileIndex(path, warnings=(EsiWarning(source, error.reason),))


@contextmanager
def _index_errors(path: str) -> Iterator[None]:
    """Raise an EsiError for an error of SQLite: the index is locked, or was damaged while open."""
    try:
        yield
    except sqlite3.Error as error:
        raise EsiError(
            f"the index cannot be used: {error}",
            file=path,
            hint="delete this file; it is made again from your ESI files",
        ) from error


def _digest(path: str) -> str:
    with open(path, "rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def _open_store(index: str) -> IndexStore:
    """Open the index; a copy in memory if it cannot be written."""
    if index == MEMORY:
        return IndexStore(MEMORY)
    writable = os.access(index if os.path.exists(index) else os.path.dirname(index), os.W_OK)
    if not (writable and os.access(os.path.dirname(index), os.W_OK)):
        return copy_in_memory(index)
    return IndexStore(index)
