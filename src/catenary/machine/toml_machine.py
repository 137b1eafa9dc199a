"""Machine from a machine file (TOML)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import UNSET

from catenary.link import LinkSource
from catenary.machine.comparison import compare
from catenary.machine.esi_files import esi_places
from catenary.machine.found import MachineParts, make_found, raise_differences
from catenary.machine.options import loop_options
from catenary.machine.read import read_machine
from catenary.target import MainDevice


class TomlMachine:
    """Machine that a machine file describes. Implements `machine.MachineDescription`."""

    def __init__(self, path: str | Path) -> None:
        """Read the file.

        Raises:
            MachineFileError: The file cannot be read, or it is not valid.
        """
        self._file = read_machine(path)

    @property
    def name(self) -> str:
        """Name of the machine, or else the path of the file."""
        return self._file.tables.name or str(self._file.path)

    def source(self) -> LinkSource:
        """Return the link source of the key `target`."""
        return self._file.source()

    def find(self, main: MainDevice, *, passive: bool) -> MachineParts:
        """Check the identities, bring the devices to PRE-OP, scan them, and make the requests.

        Args:
            main: The open MainDevice.
            passive: True to compare the identities before any device is changed.
        """
        file = self._file
        places = esi_places(file)
        if passive:
            raise_differences(file.path, compare(file.tables.device, main.passive_scan()))
        found = compare(file.tables.device, main.scan(strict=False, esi=places))
        raise_differences(file.path, found)
        return make_found(file, found)

    def loop_options(self, parts: MachineParts) -> dict[str, Any]:
        """Return the options of the file for a loop.

        Raises:
            MachineFileError: There are no drives, process data or copies with present devices.
            KeyError: The device of `clocks.reference` is absent.
        """
        if not (parts.drives or parts.process_data or parts.copies):
            raise self._file.error(
                (),
                "no drives, process data or copies have all their devices present",
                hint="connect the missing devices, or add a [drives.NAME] table: "
                "docs/reference/machine_file.md",
            )
        reference = self._file.tables.clocks.reference
        return loop_options(self._file, None if reference is UNSET else parts.subs[reference])
