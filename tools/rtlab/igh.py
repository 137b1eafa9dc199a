"""Built files of the IgH EtherCAT master for the guest.

The lab does not contain or build IgH. Build it by its INSTALL file for the headers of the guest's
kernel, and give the folder.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from tools.rtlab import archive
from tools.rtlab.archive import Entry
from tools.rtlab.errors import LabError
from tools.rtlab.kernel import Kernel, read_module

MODULES = ("ec_master", "ec_generic")  # in the order in which they are loaded
LIBRARY = "libethercat.so.1"
FOLDER = "/igh"  # of the guest
TABLE = "igh_table.py"


class NotThere(LabError):
    """Error if the folder has no IgH master for this kernel. The table is then skipped."""


def provide(folder: Path | None, kernel: Kernel) -> list[Entry]:
    """Return the files of a build for the guest.

    Raises:
        NotThere: A file is missing or does not fit the kernel.
    """
    if folder is None:
        raise NotThere("IGH=path is not a build of the IgH EtherCAT master (docs/how_to/igh.md)")
    found = [*modules(folder, kernel), library(folder)]
    program = Path(__file__).with_name(TABLE)
    return [*found, archive.text(f"{FOLDER}/{TABLE}", program.read_text())]


def modules(
    folder: Path, kernel: Kernel, names: Sequence[str] = MODULES, target: str = FOLDER
) -> Iterator[Entry]:
    """Yield built modules.

    Args:
        folder: folder of the build.
        kernel: kernel of the guest.
        names: names of the modules.
        target: folder in the guest.

    Raises:
        NotThere: A module is missing or was built for another kernel.
    """
    for name in names:
        file = newest(folder, f"{name}.ko") or newest(folder, f"{name}.ko.xz")
        if file is None:
            raise NotThere(f"no {name}.ko in {folder}: build it for Linux {kernel.release}")
        content = read_module(file)
        built_for = release_of(content)
        if built_for != kernel.release:
            raise NotThere(
                f"{file} was built for Linux {built_for or '(unknown)'}, the guest runs "
                f"{kernel.release}: build it with linux-headers-{kernel.release}"
            )
        yield Entry(f"{target}/{name}.ko", 0o100644, data=content)


def library(folder: Path) -> Entry:
    file = newest(folder, LIBRARY)
    if file is None:
        raise NotThere(f"no {LIBRARY} in {folder}: build IgH's library, too")
    return archive.copy_of(file, f"{FOLDER}/{LIBRARY}")


def newest(folder: Path, name: str) -> Path | None:
    """Return the newest file of a name below a folder."""
    return max(folder.rglob(name), key=lambda file: file.stat().st_mtime, default=None)


def release_of(module: bytes) -> str:
    """Return the first word of the `vermagic` in its `.modinfo`."""
    found = re.search(rb"\0?vermagic=([^\0 ]*)", module)
    return found[1].decode(errors="replace") if found else ""
