"""Comparison of a machine file with a clone: `compare` for devices in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
from msgspec import UNSET

from catenary.errors import CloneError
from catenary.line.values import ClonedDevice, Line
from catenary.machine.comparison import Comparison, compare
from catenary.machine.schema import DeviceTable
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Identity
from catenary.wire.register import INFORMATION


@dataclass(frozen=True, slots=True)
class FoundInClone:
    """A device of a clone, with the attributes of a `SubDevice` that a comparison uses."""

    description: DeviceDescription

    @property
    def position(self) -> int:
        """Position on the segment."""
        return self.description.position

    @property
    def name(self) -> str:
        """Name in the SII."""
        return self.description.name

    @property
    def alias(self) -> int:
        """Station alias; 0 if the device has none."""
        return self.description.alias

    @property
    def identity(self) -> Identity:
        """Vendor, product, revision and serial number."""
        return self.description.identity


def compare_clone(
    expected: Sequence[DeviceTable], line: Line, folder: str
) -> tuple[Comparison[FoundInClone], ...]:
    """Compare the devices of a machine file with those of a clone.

    Serial numbers are not compared if the clone has none.

    Args:
        expected: Devices of the file.
        line: The clone.
        folder: Its folder, for errors.

    Raises:
        CloneError: The clone has no EEPROM of a device.
    """
    if not line.serials:
        expected = [_without_serial(each) for each in expected]
    return compare(expected, [_found(each, folder) for each in line.devices])


def _without_serial(device: DeviceTable) -> DeviceTable:
    identity = msgspec.structs.replace(device.identity, serial=UNSET)
    return msgspec.structs.replace(device, identity=identity)


def _found(device: ClonedDevice, folder: str) -> FoundInClone:
    if device.sii is None:
        reason = device.missing.get("sii", "")
        raise CloneError(
            f"device {device.position} has no EEPROM in the clone: {reason}",
            file=folder,
            hint="clone it in PRE-OP or INIT: without the EEPROM, its identity is unknown",
        )
    description = describe(
        device.position,
        station_address=device.station_address,
        alias=device.alias,
        dl_status=device.dl_status,
        information=device.registers.get(INFORMATION.address, bytes(INFORMATION.size)),
        image=device.sii,
    )
    return FoundInClone(description)
