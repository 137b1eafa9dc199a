"""ESI files of a machine file: `esi` at its top, and `esi` of a device."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from msgspec import UNSET

from catenary.bus import SubDevice
from catenary.machine.file import MachineFile
from catenary.toml_lines import KeyPath


def esi_places(file: MachineFile) -> list[Path] | None:
    """Return the ESI files and folders, those of devices first; None for the user's library.

    Raises:
        MachineFileError: A file or folder does not exist.
    """
    given: list[tuple[KeyPath, str]] = [
        (("device", number, "esi"), device.esi)
        for number, device in enumerate(file.tables.device)
        if device.esi is not UNSET
    ]
    if file.tables.esi is not UNSET:
        given.append((("esi",), file.tables.esi))
    for path, text in given:
        if not _place(file, text).exists():
            raise file.error(
                path,
                f"there is no file or folder {_place(file, text)}",
                hint="the path is relative to the folder of the machine file",
            )
    return list(dict.fromkeys(_place(file, text) for _, text in given)) or None


def check_esi_files(file: MachineFile, subs: Mapping[str, SubDevice]) -> None:
    """Check that the ESI of each device comes from its own file, if it has the key `esi`.

    Args:
        file: the machine file.
        subs: devices that were found, by name.

    Raises:
        MachineFileError: The file of a device does not describe it.
    """
    for number, device in enumerate(file.tables.device):
        if device.esi is UNSET or device.name not in subs:
            continue
        sub, place = subs[device.name], _place(file, device.esi)
        used = None if sub.esi is None else Path(sub.esi.source.file)
        if used is not None and used.is_relative_to(place):
            continue
        notes = [note for note in sub.description.notes if "ESI" in note]
        identity = sub.identity
        raise file.error(
            ("device", number, "esi"),
            f'{place} does not describe device "{device.name}", which is '
            f"0x{identity.vendor:08X}:0x{identity.product:08X}:0x{identity.revision:08X}"
            + "".join(f"; {note}" for note in notes),
            hint="use the ESI file of this device, or remove the key",
        )


def _place(file: MachineFile, text: str) -> Path:
    return Path(os.path.abspath(Path(file.path).parent / text))  # without "..", as in a library
