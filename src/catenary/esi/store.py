"""SQLite index of ESI files. It is a cache: everything in it can be read from the files again."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.record import FileIndex, FileState, IndexEntry, Kind, Record
from catenary.esi.source import EsiWarning, Source
from catenary.esi.sources import Found

VERSION = 1  # of the schema and of what the indexer reads; another one is replaced
MEMORY = ":memory:"
BUSY = 30.0  # longest wait while another process writes [s]
SCHEMA = """
CREATE TABLE files (
    path TEXT PRIMARY KEY, root TEXT, source_order INTEGER,
    size INTEGER, mtime_ns INTEGER, digest TEXT,
    encoding TEXT, vendor INTEGER, vendor_name TEXT,
    groups TEXT, refs TEXT, warnings TEXT
);
CREATE TABLE entries (
    path TEXT, kind TEXT, start INTEGER, length INTEGER, line INTEGER,
    vendor INTEGER, product INTEGER, revision INTEGER, ident INTEGER, module_class TEXT,
    type TEXT, name TEXT, revision_check TEXT, hides TEXT
);
CREATE INDEX entry_path ON entries (path);
CREATE INDEX entry_key ON entries (kind, vendor, product);
CREATE INDEX entry_ident ON entries (kind, ident);
"""
JOINED = (
    "SELECT e.path, kind, start, length, line, e.vendor, product, revision, ident, module_class,"
    " type, name, revision_check, hides, root, source_order"
    " FROM entries e JOIN files f ON e.path = f.path"
)
ORDER = " ORDER BY source_order DESC, e.path, line"


class IndexStore:
    """Connection to the index. It owns the tables."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.connection = connect(path)

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()

    def states(self) -> dict[str, tuple[FileState, Found]]:
        """Return the state of every indexed file, by path."""
        rows = self.connection.execute(
            "SELECT path, size, mtime_ns, digest, root, source_order FROM files"
        )
        return {
            path: (FileState(size, mtime_ns, digest), Found(path, root, order))
            for path, size, mtime_ns, digest, root, order in rows
        }

    def write(
        self,
        changed: Iterable[tuple[Found, FileState, FileIndex]],
        moved: Iterable[tuple[Found, FileState]],
        gone: Iterable[str],
    ) -> None:
        """Change the index in one transaction.

        Args:
            changed: Files to index again.
            moved: Files with the same content, but another time or source.
            gone: Paths of files to remove.
        """
        with self.connection as open_transaction:
            open_transaction.execute("BEGIN IMMEDIATE")
            for path in gone:
                self._remove(path)
            for found, state, index in changed:
                self._remove(found.path)
                self._insert(found, state, index)
            for found, state in moved:
                open_transaction.execute(
                    "UPDATE files SET root=?, source_order=?, size=?, mtime_ns=? WHERE path=?",
                    (found.root, found.order, state.size, state.mtime_ns, found.path),
                )

    def _remove(self, path: str) -> None:
        self.connection.execute("DELETE FROM entries WHERE path=?", (path,))
        self.connection.execute("DELETE FROM files WHERE path=?", (path,))

    def _insert(self, found: Found, state: FileState, index: FileIndex) -> None:
        warnings = [(each.source.line, each.message) for each in index.warnings]
        row = (
            *(found.path, found.root, found.order, *state),
            *(index.encoding, index.vendor, index.vendor_name),
            *(json.dumps(each) for each in (index.groups, index.references, warnings)),
        )
        self.connection.execute(f"INSERT INTO files VALUES ({','.join('?' * len(row))})", row)
        rows = [(found.path, *_row(entry)) for entry in index.entries]
        self.connection.executemany(f"INSERT INTO entries VALUES ({','.join('?' * 14)})", rows)

    def records(self, where: str = "1", *values: int | str) -> list[Record]:
        """Return the entries that fulfil a condition, the preferred ones first.

        Args:
            where: Condition in SQL, with a question mark for each value.
            values: The values.
        """
        rows = self.connection.execute(f"{JOINED} WHERE {where}{ORDER}", values)
        return [_record(row) for row in rows]

    def file(self, path: str) -> FileIndex | None:
        """Return what the devices of a file share, without its entries; None if not indexed."""
        row = self.connection.execute(
            "SELECT encoding, vendor, vendor_name, groups, refs, warnings FROM files WHERE path=?",
            (path,),
        ).fetchone()
        if row is None:
            return None
        encoding, vendor, vendor_name, groups, references, warnings = row
        return FileIndex(
            path,
            encoding,
            vendor,
            vendor_name,
            groups=json.loads(groups),
            references=tuple(json.loads(references)),
            warnings=tuple(EsiWarning(Source(path, n), text) for n, text in json.loads(warnings)),
        )


def connect(path: str) -> sqlite3.Connection:
    """Open an index. A new one is created if the file is damaged or of another version."""
    try:
        return _opened(path)
    except sqlite3.OperationalError:  # locked, or not writable: not damaged
        raise
    except sqlite3.DatabaseError:
        for suffix in ("", "-journal"):
            Path(path + suffix).unlink(missing_ok=True)
        return _opened(path)


def copy_in_memory(path: str) -> IndexStore:
    """Return a copy in memory of an index that cannot be written; empty if it cannot be read."""
    store = IndexStore(MEMORY)
    with (
        suppress(sqlite3.Error),  # then every file is indexed again
        closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as original,
    ):
        if original.execute("PRAGMA user_version").fetchone() == (VERSION,):
            original.backup(store.connection)
    return store


def _opened(path: str) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=BUSY, isolation_level=None, check_same_thread=False)
    try:
        if connection.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise sqlite3.DatabaseError(f"{path} is damaged")
        if connection.execute("PRAGMA user_version").fetchone() != (VERSION,):
            _create(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def _create(connection: sqlite3.Connection) -> None:
    """Create the tables, unless another process has just done so."""
    connection.execute("BEGIN IMMEDIATE")
    if connection.execute("PRAGMA user_version").fetchone() != (VERSION,):
        for table in ("files", "entries"):
            connection.execute(f"DROP TABLE IF EXISTS {table}")
        for statement in SCHEMA.split(";"):
            connection.execute(statement)
        connection.execute(f"PRAGMA user_version={VERSION}")
    connection.execute("COMMIT")


def _row(entry: IndexEntry) -> tuple[object, ...]:
    return (
        *(str(entry.kind), entry.offset, entry.length, entry.line),
        *(
            entry.vendor,
            entry.product,
            entry.revision,
            entry.ident,
            entry.module_class,
            entry.type,
            entry.name,
        ),
        *(str(entry.revision_check), json.dumps(entry.hides)),
    )


def _record(row: tuple[Any, ...]) -> Record:
    path, *values, check, hides, root, order = row
    names = ("kind", "offset", "length", "line", "vendor", "product", "revision")
    fields = dict(zip((*names, "ident", "module_class", "type", "name"), values, strict=True))
    fields["kind"] = Kind(fields["kind"])
    fields["revision_check"] = RevisionCheck(check)
    fields["hides"] = tuple(DeviceKey(*each) for each in json.loads(hides))
    entry = IndexEntry(**fields)
    return Record(entry, path, root, order)
