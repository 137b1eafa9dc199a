"""Virtual device from the ESI of a vendor: memory, mailbox, objects, process data and modules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from catenary.errors import ConfigurationError
from catenary.esi.device import EsiDevice
from catenary.esi.module_choice import ModuleName, choose_modules
from catenary.esi.placement import default_placements, slot_places, with_placements
from catenary.esi.selection import select_device
from catenary.esi.sii import assemble_sii
from catenary.virtual.blueprint import Blueprint
from catenary.virtual.coe.esi_objects import esi_objects
from catenary.virtual.coe.module_lists import CONFIGURED, ModuleLists
from catenary.virtual.crystal import EXACT, Crystal
from catenary.virtual.devices.application import Application
from catenary.virtual.devices.twin import NO_OPTIONS, Twin, TwinOptions
from catenary.virtual.esi_description import describe_esi
from catenary.wire.sii import MailboxProtocol, decode_sii


class DescribedDevice(Twin):
    """Virtual device with the SII, objects and process data of an ESI."""

    kind = "esi"

    def __init__(
        self,
        device: EsiDevice,
        *,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        options: TwinOptions = NO_OPTIONS,
    ) -> None:
        """Initialise the device.

        Args:
            device: Device of an ESI. Its default modules are in place.
            name: Name in messages; empty: that of the ESI. The SII has the name of the ESI.
            alias: Station alias.
            serial: Serial number.
            options: Properties that the ESI does not give, and the modules in the slots.

        Raises:
            ValueError: A value is out of range.
            ConfigurationError: The ESI does not give a valid SII, or a slot does not accept a
                module.
        """
        if not 0 <= alias <= 0xFFFF:
            raise ValueError(f"alias must be 0 to 65535, not {alias}")
        coe = device.mailbox is None or MailboxProtocol.COE in device.mailbox.protocols
        modules = options.modules
        placed = default_placements(device) if modules is None else choose_modules(device, modules)
        self._modular = device if coe else replace(device, slots=None)
        self._detected = {each.place.number: each.module.ident for each in placed}
        self.esi = with_placements(device, placed)
        image = _image(device, serial, alias)
        super().__init__(
            Blueprint(
                describe_esi(self.esi, decode_sii(image), serial=serial),
                image,
                _ports(device.physics),
                esi_objects(self.esi),
                serves_coe=coe,
            ),
            name=name,
            options=options,
        )

    def add_objects(self, application: Application) -> None:
        super().add_objects(application)
        slots = self._modular.slots
        if slots is None:
            return
        count = len(list(slot_places(slots)))
        detected = [self._detected.get(slot, 0) for slot in range(count)]
        given = self._modular.dictionary
        entries = [given.entry(CONFIGURED, k + 1) for k in range(count)] if given else []
        known = [int.from_bytes(e.default or b"", "little") if e else 0 for e in entries]
        without = [0] * count if slots.download_module_idents else detected
        lists = ModuleLists(count, detected, known if any(entries) else without)
        lists.add_to(application.dictionary, slots.index_increment)
        application.module_lists = lists


def from_esi(
    source: str | PathLike[str] | EsiDevice,
    device: str = "",
    *,
    name: str = "",
    alias: int = 0,
    serial: int = 0,
    crystal: Crystal = EXACT,
    modules: Sequence[ModuleName | None] | None = None,
) -> DescribedDevice:
    """Return a virtual device from an ESI.

    Args:
        source: Path of the ESI file, or a device that was read from one.
        device: Device in the file: order code, name, or PRODUCT[:REVISION]. Needed if the file has
            several devices.
        name: Name in messages; empty: that of the ESI.
        alias: Station alias.
        serial: Serial number.
        crystal: Frequency error and jitter of the clock.
        modules: Module of each slot of a modular device: name, type or ident; None for an empty
            slot. Without a list, the default modules are plugged in.

    Raises:
        EsiError: The file cannot be read.
        ConfigurationError: The file has no such device, gives no valid SII, or a slot does not
            accept a module.
    """
    if not isinstance(source, EsiDevice):
        source = esi_device(source, device)
    options = TwinOptions(crystal=crystal, modules=modules)
    return DescribedDevice(source, name=name, alias=alias, serial=serial, options=options)


def esi_device(path: str | PathLike[str], wanted: str = "") -> EsiDevice:
    """Return a device from an ESI file, with the modules and dictionary of files next to it.

    Args:
        path: Path of the file.
        wanted: Order code, name, or PRODUCT[:REVISION]; needed if the file has several devices.

    Raises:
        EsiError: The file cannot be read.
        ConfigurationError: The file has no such device.
    """
    # The parser and the library are loaded only for ESI files.
    from catenary.esi.library import Library
    from catenary.esi.reader import read_esi

    device = select_device(read_esi(Path(path)), wanted)
    if not device.dictionary_file and (device.slots is None or device.modules):
        return device
    with Library.of(path) as library:  # it reads the files that this one refers to
        return library.find(*device.key, order=device.type) or device


def _ports(physics: str) -> tuple[int, ...]:
    """Return the ports that the device has; two if the file names none."""
    found = tuple(port for port, letter in enumerate(physics[:4]) if not letter.isspace())
    return found if 0 in found else (0, 1)


def _image(device: EsiDevice, serial: int, alias: int) -> bytes:
    """Return the SII, in a larger EEPROM if it does not fit into that of the file."""
    try:
        return assemble_sii(device, serial=serial, alias=alias).image
    except ConfigurationError:
        if device.eeprom is None or not device.eeprom.byte_size:
            raise
        larger = replace(device, eeprom=replace(device.eeprom, byte_size=0))
        return assemble_sii(larger, serial=serial, alias=alias).image
