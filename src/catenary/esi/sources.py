"""Files and folders of a library, in the order in which they were added, and its lock."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from catenary.errors import EsiError
from catenary.esi.references import inside

MAX_FILES = 20_000  # of one folder
MAX_FOLDERS = 20_000
MAX_DEPTH = 16
LOCK_TIMEOUT = 60.0  # [s]; an index of 45 MB takes 5 s
POLL = 0.02  # [s]


class Found(NamedTuple):
    """XML file of a source."""

    path: str
    root: str  # folder that its references cannot leave
    order: int  # of the source


class Listing(NamedTuple):
    """XML files of all sources, by path, and the sources that cannot be read."""

    files: dict[str, Found]
    problems: tuple[str, ...]


def list_files(sources: Sequence[Path]) -> Listing:
    """Return the XML files of files and folders.

    A file that several sources contain belongs to the last one. A folder with too many files is
    reported, and the others are used.

    Args:
        sources: Absolute paths.
    """
    files: dict[str, Found] = {}
    problems: list[str] = []
    for order, source in enumerate(sources):
        if source.is_dir():
            try:
                for path in walk(source, problems):
                    files[path] = Found(path, str(source), order)
            except EsiError as error:
                problems.append(error.message)
        elif source.is_file():
            files[str(source)] = Found(str(source), str(source.parent), order)
        else:
            problems.append(f"{source}: missing; add it again, or remove it from the library")
    return Listing(files, tuple(problems))


def walk(folder: Path, problems: list[str]) -> Iterator[str]:
    """Yield the XML files of a folder and its subfolders, in the order of their names.

    Args:
        folder: The folder.
        problems: Receives what cannot be read.

    Raises:
        EsiError: The folder has too many files or subfolders.
    """

    def failed(error: OSError) -> None:
        problems.append(f"{error.filename}: {error.strerror}")

    count = 0
    for number, (place, folders, names) in enumerate(os.walk(folder, onerror=failed)):
        if number >= MAX_FOLDERS:
            raise _too_many(folder, f"{MAX_FOLDERS} folders")
        if folders and len(Path(place).relative_to(folder).parts) >= MAX_DEPTH:
            problems.append(f"{place}: folders below level {MAX_DEPTH} are not searched")
            folders.clear()
        folders[:] = sorted(each for each in folders if not each.startswith("."))
        for name in sorted(each for each in names if each.lower().endswith(".xml")):
            count += 1
            if count > MAX_FILES:
                raise _too_many(folder, f"{MAX_FILES} XML files")
            path = Path(place, name)
            if path.is_file() and inside(path, folder):  # not a link that leaves the folder
                yield str(path)


def _too_many(folder: Path, what: str) -> EsiError:
    return EsiError(f"more than {what}", file=str(folder), hint="use a smaller folder")


def read_sources(file: Path) -> list[Path]:
    """Return the sources that a library file lists; none if it does not exist.

    Raises:
        EsiError: The file is invalid.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))["sources"]
        return [Path(str(each)) for each in found]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except (ValueError, KeyError, TypeError) as error:
        raise EsiError(
            f"the list of ESI files is damaged: {error}",
            file=str(file),
            hint=f"delete {file} and add your files again: catenary esi add FOLDER",
        ) from error


def write_sources(file: Path, sources: Sequence[Path]) -> None:
    """Replace the list of sources. A reader sees the old or the new one, never a part.

    Args:
        file: File of the library.
        sources: Absolute paths.
    """
    text = json.dumps({"sources": [str(each) for each in sources]}, indent=1)
    new = file.with_suffix(f".{os.getpid()}")
    new.write_text(text + "\n", encoding="utf-8")
    os.replace(new, file)


@contextmanager
def locked(file: Path | None, timeout: float = LOCK_TIMEOUT) -> Iterator[None]:
    """Hold the lock of a library. Other processes that change it wait.

    Args:
        file: Lock file, created if needed; None for a library of this process alone.
        timeout: Longest wait [s].

    Raises:
        EsiError: Another process holds the lock for longer.
    """
    if file is None:
        yield
        return
    with open(file, "a", encoding="utf-8") as opened:
        end = time.monotonic() + timeout
        while not _try_lock(opened.fileno()):
            if time.monotonic() > end:
                raise EsiError(
                    f"another process has locked the ESI library for {timeout:.0f} s",
                    file=str(file),
                    hint="wait for its `catenary esi add`, or end it",
                )
            time.sleep(POLL)
        yield  # closing the file releases the lock


def _try_lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
