"""Extraction of the ESI files in a ZIP archive. Archives are not trusted: sizes are bounded."""

from __future__ import annotations

import errno
import lzma
import os
import shutil
import stat
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import IO, NamedTuple

from catenary.errors import EsiError
from catenary.esi.references import parts_of

CHUNK = 1 << 20  # [bytes]
FAILURES = (
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, ValueError),
    *(lzma.LZMAError, MemoryError),  # MemoryError: the dictionary size that LZMA data state
    *(FileExistsError, NotADirectoryError),  # a member is a file and a folder
)
OF_MEMBERS = (None, errno.ENAMETOOLONG)  # None: faulty bzip2 data
ENCRYPTED = 0x1  # bit of `flag_bits`


class Bounds(NamedTuple):
    """Limits of an archive."""

    members: int = 5000
    member_size: int = 256 << 20  # [bytes]
    total_size: int = 1 << 30  # [bytes]
    ratio: int = 250  # of the sizes; ESI files reach about 40
    small: int = 1 << 20  # [bytes]; below, the ratio does not matter


BOUNDS = Bounds()


def extract(archive: Path, folder: Path, bounds: Bounds = BOUNDS) -> list[Path]:
    """Extract the XML files of an archive into a new folder, all of them or none.

    Args:
        archive: The ZIP file.
        folder: Folder to create. It is replaced if it exists. Its parent has to exist.
        bounds: Limits. Nothing is written if the archive states more.

    Returns:
        The files, in the order of the archive.

    Raises:
        EsiError: The archive is invalid, unsafe, too large, or without XML files.
    """
    work = Path(tempfile.mkdtemp(prefix=".new-", dir=folder.parent))
    try:
        with zipfile.ZipFile(archive) as opened:
            members = _checked(archive, opened.infolist(), bounds)
            _write_all(archive, opened, members, work, bounds)
        shutil.rmtree(folder, ignore_errors=True)
        os.replace(work, folder)
    except FAILURES as error:
        raise _invalid(archive, error) from error
    except OSError as error:
        if error.errno in OF_MEMBERS:
            raise _invalid(archive, error) from error
        raise
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return [folder.joinpath(*parts) for parts in members.values()]


def _checked(
    archive: Path, members: list[zipfile.ZipInfo], bounds: Bounds
) -> dict[zipfile.ZipInfo, tuple[str, ...]]:
    """Check all members before anything is written, and return the XML files with their parts."""
    if len(members) > bounds.members:
        raise _refusal(archive, f"has {len(members)} members; the limit is {bounds.members}")
    found: dict[zipfile.ZipInfo, tuple[str, ...]] = {}
    names: set[str] = set()
    for member in members:
        parts = _safe_parts(archive, member)
        name = "/".join(parts).casefold()
        if name in names and not member.is_dir():
            raise _refusal(archive, f"has two members with the name {member.filename!r}")
        names.add(name)
        if name.endswith(".xml") and not member.is_dir():
            _check_size(archive, member, bounds)
            found[member] = parts
    if sum(member.file_size for member in found) > bounds.total_size:
        raise _refusal(archive, f"is larger than {bounds.total_size} bytes when extracted")
    if not found:
        raise EsiError(
            "the archive has no XML file", file=str(archive), hint="add the vendor's ESI file"
        )
    return found


def _safe_parts(archive: Path, member: zipfile.ZipInfo) -> tuple[str, ...]:
    parts = parts_of(member.filename.rstrip("/\\"))
    if parts is None or ".." in parts:
        raise _refusal(archive, f"member {member.filename!r} would leave the library folder")
    if stat.S_ISLNK(member.external_attr >> 16):
        raise _refusal(archive, f"member {member.filename!r} is a symbolic link")
    if member.flag_bits & ENCRYPTED:
        raise _refusal(archive, f"member {member.filename!r} is encrypted")
    return tuple(parts)


def _check_size(archive: Path, member: zipfile.ZipInfo, bounds: Bounds) -> None:
    if member.file_size > bounds.member_size:
        raise _refusal(
            archive,
            f"member {member.filename!r} has {member.file_size} bytes; "
            f"the limit is {bounds.member_size}",
        )
    ratio = member.file_size / max(member.compress_size, 1)
    if member.file_size > bounds.small and ratio > bounds.ratio:
        raise _refusal(
            archive,
            f"member {member.filename!r} is compressed {ratio:.0f}:1; "
            f"the limit is {bounds.ratio}:1",
        )


def _write_all(
    archive: Path,
    opened: zipfile.ZipFile,
    members: dict[zipfile.ZipInfo, tuple[str, ...]],
    folder: Path,
    bounds: Bounds,
) -> None:
    left = bounds.total_size
    for member, parts in members.items():
        target = folder.joinpath(*parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        with opened.open(member) as source, open(target, "xb") as copy:
            left -= _copy(source, copy, min(left, bounds.member_size))
        if left < 0:
            raise _refusal(archive, "is larger than it states")


def _copy(source: IO[bytes], copy: IO[bytes], limit: int) -> int:
    """Copy the data, and return the number of bytes. Stop after the chunk that exceeds `limit`."""
    done = 0
    while done <= limit and (chunk := source.read(CHUNK)):
        copy.write(chunk)
        done += len(chunk)
    return done


def _invalid(archive: Path, error: Exception) -> EsiError:
    return EsiError(
        f"not a valid ZIP archive: {error}", file=str(archive), hint="download the file again"
    )


def _refusal(archive: Path, problem: str) -> EsiError:
    return EsiError(
        f"the archive is refused: {problem}",
        file=str(archive),
        hint="extract it by hand, check the files, and add the folder",
    )
