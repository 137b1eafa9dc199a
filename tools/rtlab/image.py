"""Root file system of the guest as one file.

It is rebuilt if the kernel, Python or a package changes. Each working copy has its own file.
"""

from __future__ import annotations

import contextlib
import hashlib
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from benchmarks.compiler import compile_all
from tools.rtlab import archive, root
from tools.rtlab.archive import Entry
from tools.rtlab.kernel import Kernel


def provide(kernel: Kernel, repository: Path, folder: Path, more: Sequence[Entry] = ()) -> Path:
    """Return the image in `folder`. Build it if it is missing or outdated.

    Args:
        kernel: Kernel of the guest.
        repository: Working copy.
        folder: Folder of the image.
        more: Additional entries.

    Raises:
        OSError: The disk is full.
        CatenaryError: The C peers do not compile.
    """
    with tempfile.TemporaryDirectory(dir=folder) as programs:
        compiled = compile_all(Path(programs))
        entries = [*root.entries(kernel, root.everything(repository), compiled), *more]
    image, said = folder / "root.cpio", folder / "root.fingerprint"
    fingerprint = fingerprint_of(entries, kernel)
    if not (image.exists() and said.exists() and said.read_text() == fingerprint):
        print("rtlab: making the guest's root", flush=True)
        said.unlink(missing_ok=True)
        write(entries, image)
        said.write_text(fingerprint)
    return image


def write(entries: Iterable[Entry], image: Path) -> None:
    """Write the image completely, or not at all."""
    part = image.with_suffix(".part")
    try:
        with part.open("wb") as file:
            archive.write(entries, file)
        part.replace(image)
    finally:
        with contextlib.suppress(FileNotFoundError):
            part.unlink()


def fingerprint_of(entries: Iterable[Entry], kernel: Kernel) -> str:
    digest = hashlib.sha256(kernel.package.encode())
    for entry in entries:
        digest.update(archive.fingerprint_of(entry).encode() + b"\n")
    return digest.hexdigest()
