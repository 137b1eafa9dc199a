"""Virtual devices of other makers: a force sensor, and a drive with manufacturer objects."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace

from catenary.virtual import MappingQuirks, Servo
from catenary.virtual.coe.dictionary import (
    BOOLEAN,
    INTEGER16,
    MAP_RX,
    MAP_TX,
    READ_ANY,
    REAL32,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_ANY,
    Dictionary,
    Entry,
    number,
    stored,
)
from catenary.virtual.crystal import EXACT
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import AppliedDevice
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS

FORCE, STATUS, TARE, LAMP, RATE = range(5)
PERIOD_NS = 500_000
RX = (
    Pdo(
        0x1600,
        "Commands",
        (
            MappedEntry(0x7000, 1, 1, "Tare", BOOLEAN),
            MappedEntry(0, 0, 7, "", 0),
            MappedEntry(0x7010, 0, 16, "Lamp", UNSIGNED16),
        ),
        2,
    ),
)
TX = (
    Pdo(
        0x1A00,
        "Readings",
        (
            MappedEntry(0x6000, 1, 32, "Force", REAL32),
            MappedEntry(0x6000, 0x12, 16, "Rate", INTEGER16),
        ),
        3,
    ),
)


class ForceSensor(AppliedDevice):
    """A sensor with a force [N] (REAL), a status (UDINT, not mapped by default), and outputs."""

    kind = "force_sensor"

    def __init__(self, mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS) -> None:
        super().__init__(
            name="Force sensor",
            alias=0,
            serial=0,
            lrw=True,
            crystal=EXACT,
            clock_bits=64,
            sii_quirks=NO_SII_QUIRKS,
        )
        self.mapping_quirks = mapping_quirks
        self.force = 0.0  # [N] measured force
        self.status = 7
        self.rate = 0  # raw
        self.writes: list[tuple[int, int, bytes]] = []

    def description(self) -> Description:
        return Description(
            name=self.name,
            order="FORCE",
            group="Sensors",
            product_code=0x000A_0001,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes, self.mapping_quirks.coe_details),
            sync_managers=sync_managers_of(self.mailbox_bytes, RX, TX),
            fmmus=(1, 2, 3),
            rx_pdos=RX,
            tx_pdos=TX,
            clock=False,
            slots=5,
            mapping_quirks=self.mapping_quirks,
            lrw=self.lrw,
        )

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        self.measure()
        self.core.run_model(self.position, PERIOD_NS)

    def measure(self) -> None:
        """Update the measured quantities."""
        [raw] = struct.unpack("<i", struct.pack("<f", self.force))
        for slot, value in ((FORCE, raw), (STATUS, self.status), (RATE, self.rate)):
            self.core.put_slot(self.position, slot, value)
        self.core.refresh_inputs(self.position)

    def add_objects(self, application: Application) -> None:
        entry, read, write = application.slot_entry, READ_ANY | MAP_TX, READ_ANY | MAP_RX
        add = application.dictionary.add
        count = number("Number of entries", UNSIGNED8, 0x12)
        force = entry("Force", REAL32, 32, FORCE, read)
        rate = entry("Rate", INTEGER16, 16, RATE, read)
        add(0x6000, "Readings", {0: count, 1: force, 0x12: rate})
        add(
            0x7000,
            "Commands",
            {
                0: number("Number of entries", UNSIGNED8, 1),
                1: entry("Tare", BOOLEAN, 1, TARE, write),
            },
        )
        variable = application.dictionary.add_variable
        variable(0x6010, entry("Status", UNSIGNED32, 32, STATUS, read))
        variable(0x7010, entry("Lamp", UNSIGNED16, 16, LAMP, write))
        add_settings(application.dictionary, self.writes)

    @property
    def tare(self) -> bool:
        """Value of the output in the device."""
        return bool(self.core.slot(self.position, TARE) & 1)

    @property
    def lamp(self) -> int:
        """Value of the output in the device."""
        return self.core.slot(self.position, LAMP) & 0xFFFF


class TunedServo(Servo):
    """A servo with manufacturer settings, and the mappable objects 0x2020 and 0x2021."""

    def __init__(self) -> None:
        super().__init__()
        self.writes: list[tuple[int, int, bytes]] = []

    def description(self) -> Description:
        known = super().description()
        return replace(known, slots=known.slots + 2)

    def add_objects(self, application: Application) -> None:
        super().add_objects(application)
        variable, slot = application.dictionary.add_variable, self._own_slot
        temperature = application.slot_entry("Temperature", INTEGER16, 16, slot, READ_ANY | MAP_TX)
        variable(0x2020, temperature)
        lamp = application.slot_entry("Lamp", UNSIGNED16, 16, slot + 1, READ_ANY | MAP_RX)
        variable(0x2021, lamp)
        add_settings(application.dictionary, self.writes)

    @property
    def _own_slot(self) -> int:
        return super().description().slots

    def warm_up(self, raw: int) -> None:
        """Set its temperature [0.1 K]."""
        self.core.put_slot(self.position, self._own_slot, raw)
        self.core.refresh_inputs(self.position)

    @property
    def lamp(self) -> int:
        """Value of the output in the device."""
        return self.core.slot(self.position, self._own_slot + 1) & 0xFFFF


def add_settings(dictionary: Dictionary, writes: list[tuple[int, int, bytes]]) -> None:
    """Add objects for start-up. `writes` collects the written values, in order."""
    zero = bytes(4)
    dictionary.add_record(
        0x2010,
        "Controller",
        [stored(f"Gain {k}", REAL32, zero) for k in (1, 2, 3)],
    )
    dictionary.add_variable(0x2011, stored("Clamped", UNSIGNED8, b"\0"))
    dictionary.add_variable(
        0x2100, Entry("Unlock", UNSIGNED16, 16, WRITE_ANY, lambda: b"", lambda data: None)
    )
    dictionary.add_variable(0x2103, stored("Odd", 0x0800, bytes(2)))
    for place in ((0x2010, 3), (0x2011, 0), (0x2100, 0), (0x6065, 0), (0x1C13, 0)):
        index, subindex = place
        if index in dictionary.objects:
            entries = dictionary.objects[index].entries
            entries[subindex] = observed(entries[subindex], place, writes)


def observed(entry: Entry, place: tuple[int, int], writes: list[tuple[int, int, bytes]]) -> Entry:
    """Return the entry with a note of each write."""
    write = entry.write

    def note(data: bytes) -> None:
        assert write is not None
        writes.append((*place, data))
        write(data if place != (0x2011, 0) else min(data, b"\x05"))  # the device limits this one

    known: Callable[[bytes], None] | None = note
    return Entry(entry.name, entry.data_type, entry.bits, entry.access, entry.read, known)
