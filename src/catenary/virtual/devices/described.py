"""Virtual device from the ESI of a vendor: its memory, mailbox, objects and process data.

The device has no behaviour of its own: a drive does not move. Outputs and inputs are objects that
`read_object` and `write_object` access. It runs free: SYNC signals have no effect.
"""

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
from catenary.model.device import Direction
from catenary.virtual.coe.dictionary import Abort, Entry
from catenary.virtual.coe.esi_objects import EsiObjects, code_of, slots_of
from catenary.virtual.coe.module_lists import CONFIGURED, ModuleLists
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.devices.application import Application
from catenary.virtual.devices.applied import AppliedDevice, MailboxOptions
from catenary.virtual.esi_description import describe_esi, pdos_of
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS
from catenary.wire.sii import MailboxProtocol, decode_sii

TEXTS = (0x1008, 0x1009, 0x100A)  # name and versions
UPDATE_NS = 1_000_000  # interval between updates of the inputs
REFUSES_COE = MailboxQuirks(error_reply="unsupported")


class DescribedDevice(AppliedDevice):
    """Virtual device with the SII, objects and process data of an ESI."""

    kind = "esi"

    def __init__(
        self,
        device: EsiDevice,
        *,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        mailbox_delay: float = 300e-6,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        modules: Sequence[ModuleName | None] | None = None,
    ) -> None:
        """Initialise the device.

        Args:
            device: Device of an ESI. Its default modules are in place.
            name: Name in messages; empty: that of the ESI. The SII has the name of the ESI.
            alias: Station alias.
            serial: Serial number.
            mailbox_delay: Time until a request is answered [s].
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64.
            mailbox_quirks: Quirks of the mailbox.
            modules: Modules in the slots of a modular device; None: the default modules.

        Raises:
            ValueError: A value is out of range.
            ConfigurationError: The ESI does not give a valid SII, or a slot does not accept a
                module.
        """
        coe = device.mailbox is None or MailboxProtocol.COE in device.mailbox.protocols
        super().__init__(
            name=name or device.name or device.type,
            alias=alias,
            serial=serial,
            lrw=not device.use_lrd_lwr,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=NO_SII_QUIRKS,
            mailbox=MailboxOptions(
                delay=mailbox_delay, quirks=mailbox_quirks if coe else REFUSES_COE
            ),
        )
        placed = default_placements(device) if modules is None else choose_modules(device, modules)
        self._modular = device if coe else replace(device, slots=None)
        self._detected = {each.place.number: each.module.ident for each in placed}
        self.esi = with_placements(device, placed)
        self.ports = _ports(device.physics)
        self._image = _image(device, serial, alias)
        self._rx, self._tx = (pdos_of(self.esi, each) for each in Direction)
        self._slots = slots_of(self._rx, self._tx)

    def sii_image(self) -> bytes:
        """Return the content of the EEPROM. Modules are not in it, as in real devices."""
        return self._image

    def description(self) -> Description:
        return describe_esi(
            self.esi,
            decode_sii(self._image),
            name=self.name,
            serial=self.serial,
            slots=len(self._slots),
        )

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        if self._slots:
            self.core.run_model(self.position, UPDATE_NS)
        if self.description().emulation:
            self.application.map_process_data()

    def add_objects(self, application: Application) -> None:
        dictionary = application.dictionary
        own = set(dictionary.objects) - self._given_texts()
        objects = EsiObjects(self.esi, self._rx, self._tx, application.slot_entry)
        for index, (name, entries) in objects.make().items():
            if index not in own:
                dictionary.add(index, name, entries, code=code_of(entries))
        self._add_module_lists(application)
        for slot, value in objects.defaults.items():
            signed = len(value) == 8
            self.core.put_slot(self.position, slot, int.from_bytes(value, "little", signed=signed))

    def _add_module_lists(self, application: Application) -> None:
        """Add the module lists of a modular device. Its file can give the configured modules."""
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

    def _given_texts(self) -> set[int]:
        """Return the indices of name and versions that the file gives."""
        dictionary = self.esi.dictionary
        entries = [dictionary.entry(index) for index in TEXTS] if dictionary else []
        return {entry.index for entry in entries if entry is not None and entry.default}

    def read_object(self, index: int, subindex: int = 0) -> bytes:
        """Return the value of an object, such as an output, regardless of its access rights.

        Args:
            index: Index of the object.
            subindex: Subindex of the entry.

        Raises:
            LookupError: The device does not have the object.
        """
        return self._entry(index, subindex).read()

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        """Set the value of an object in a PDO, such as an input, regardless of its access rights.

        Args:
            index: Index of the object.
            subindex: Subindex of the entry.
            data: The value, little endian.

        Raises:
            LookupError: The device does not have the object in a PDO of at most 64 bits.
        """
        entry = self._entry(index, subindex)
        if entry.slot < 0:
            raise LookupError(
                f"{self.name}: 0x{index:04X}:{subindex:02X} is not in a PDO, or exceeds 64 bits"
            )
        value = int.from_bytes(data, "little", signed=len(data) == 8)
        self.core.put_slot(self.position, entry.slot, value)
        self.core.refresh_inputs(self.position)

    def _entry(self, index: int, subindex: int) -> Entry:
        try:
            return self.application.dictionary.entry(index, subindex)
        except Abort:
            raise LookupError(f"{self.name}: no object 0x{index:04X}:{subindex:02X}") from None


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
    return DescribedDevice(
        source, name=name, alias=alias, serial=serial, crystal=crystal, modules=modules
    )


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
