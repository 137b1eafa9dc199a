"""Archive of a report: a ZIP file with a manifest and the files of all parts."""

from __future__ import annotations

import json
import lzma
import os
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import msgspec

from catenary.errors import ConfigurationError

FORMAT = 1
MANIFEST = "manifest.json"
MANIFEST_BYTES = 1 << 20
FILE_BYTES = 32 << 20  # largest file of an archive
TOTAL_BYTES = 128 << 20  # largest size of all files before compression
# What `zipfile` raises for damaged, encrypted or unknown data, also of a compression.
UNREADABLE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError, EOFError)


class Part(msgspec.Struct, frozen=True):
    """Result of one part: done, incomplete, failed or skipped, and the reason."""

    name: str
    status: str
    seconds: float  # time that it took
    result: str = ""  # one line
    reason: str = ""


class Manifest(msgspec.Struct, frozen=True):
    """Content of `manifest.json`."""

    format: int
    date: str  # of the report, UTC
    target: str
    virtual_time: bool
    serials: bool  # True if the files contain serial numbers
    machine: dict[str, object]
    versions: dict[str, str]
    parts: tuple[Part, ...]
    files: dict[str, int]  # bytes of each file
    omitted: dict[str, int] = {}  # bytes of each file that was too large


def write_archive(path: Path, manifest: Manifest, folder: Path) -> Manifest:
    """Write the archive, and return the manifest with its files.

    A file of more than FILE_BYTES is omitted, and all further files after TOTAL_BYTES. An existing
    archive is replaced when the new one is complete.

    Args:
        path: Path of the archive.
        manifest: Manifest without files.
        folder: Folder with the files.
    """
    files: dict[str, int] = {}
    omitted: dict[str, int] = {}
    for name, size in sorted(_files(folder)):
        fits = size <= FILE_BYTES and sum(files.values()) + size <= TOTAL_BYTES
        (files if fits else omitted)[name] = size
    manifest = msgspec.structs.replace(manifest, files=files, omitted=omitted)
    partial = path.with_name(f"{path.name}.partial")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as file:
            file.writestr(MANIFEST, as_json(manifest))
            for name in files:
                file.write(folder / name, name)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return manifest


def _files(folder: Path) -> Iterator[tuple[str, int]]:
    for path in folder.rglob("*"):
        if path.is_file() and not path.is_symlink():
            yield str(path.relative_to(folder)), path.stat().st_size


def as_json(manifest: Manifest) -> str:
    return json.dumps(msgspec.to_builtins(manifest), indent=2)


def read_manifest(path: Path) -> Manifest:
    """Return the manifest of an archive.

    Raises:
        ConfigurationError: The file is not a report, or its format is newer.
        OSError: The file cannot be read.
    """
    try:
        with zipfile.ZipFile(path) as file, file.open(MANIFEST) as content:
            data = content.read(MANIFEST_BYTES + 1)
        if len(data) > MANIFEST_BYTES:
            raise ValueError(f"{MANIFEST} has more than {MANIFEST_BYTES} bytes")
        manifest = msgspec.json.decode(data, type=Manifest)
    except UNREADABLE as error:
        raise _not_a_report(path, str(error)) from error
    except OSError as error:
        if error.filename is not None:  # the file itself; damaged data have no name
            raise
        raise _not_a_report(path, error.strerror or str(error)) from error
    except KeyError as error:
        raise _not_a_report(path, f"it contains no {MANIFEST}") from error
    except ValueError as error:  # of msgspec, too
        raise _not_a_report(path, f"{MANIFEST}: {error}") from error
    if manifest.format > FORMAT:
        raise ConfigurationError(
            f"{path}: the report has format {manifest.format}, and this version reads format "
            f"{FORMAT}",
            hint="update Catenary",
        )
    return manifest


def _not_a_report(path: Path, reason: str) -> ConfigurationError:
    return ConfigurationError(
        f"{path} is not a report: {reason}", hint="catenary report TARGET writes one"
    )
