"""Devices of a clone folder, and how they are connected."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from catenary.errors import ConfigurationError
from catenary.line import read_line
from catenary.virtual.devices.twin import NO_OPTIONS, Twin, TwinOptions
from catenary.virtual.line_blueprint import cloned_blueprint, parents
from catenary.virtual.wiring import Place, Wiring

AGAIN = "clone the segment again, without loose cables"


class ClonedLine(NamedTuple):
    """Twins of the devices of a clone, and the ports that they are connected to."""

    devices: list[Twin]
    behind: dict[int, Place]


def cloned_line(
    folder: str | PathLike[str], options: Mapping[str, TwinOptions] | None = None
) -> ClonedLine:
    """Return twins of the devices of a clone.

    Args:
        folder: Folder that `catenary clone` has written.
        options: Options of devices by name; None: the standard ones.

    Raises:
        CloneError: A file of the folder is missing or not valid.
        ConfigurationError: The SII of a device was not read, the devices cannot be connected, or an
            option names no device.
    """
    line = read_line(Path(folder))
    given = options or {}
    names = [device.name for device in line.devices]
    for name in given:
        if name not in names:
            raise ConfigurationError(
                f"{folder}: no device is named {name!r}", hint=f"it has {', '.join(names)}"
            )
    twins = [
        Twin(
            cloned_blueprint(device, str(folder)),
            name=device.name,
            options=given.get(device.name, NO_OPTIONS),
        )
        for device in line.devices
    ]
    behind = parents(line.devices)
    try:
        Wiring([twin.ports for twin in twins], behind, ring=False)
    except ValueError as error:
        raise ConfigurationError(f"{folder}: {error}", hint=AGAIN) from error
    return ClonedLine(twins, behind)
