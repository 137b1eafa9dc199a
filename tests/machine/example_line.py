"""A virtual segment with the devices of shared/examples/machine.toml."""

from __future__ import annotations

import struct
from dataclasses import replace

from catenary.virtual import Coupler, DigitalOutputs, Segment, Servo, ServoQuirks
from catenary.virtual.coe.dictionary import (
    BOOLEAN,
    INTEGER16,
    MAP_TX,
    READ_ANY,
    UNSIGNED8,
    UNSIGNED16,
    Entry,
    number,
    stored,
)
from catenary.virtual.crystal import EXACT
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices import Device
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import AppliedDevice, MailboxOptions
from catenary.virtual.op_modes import FREE_RUN, OpMode
from catenary.virtual.sii_image import make_sii_image
from catenary.virtual.sii_quirks import NO_SII_QUIRKS

IDENTITY = 0x10  # byte of vendor, product and revision in an EEPROM, ETG.1000.6 table 16
MAILBOX_BYTES = 128
SYNC0 = (FREE_RUN, OpMode(name="DC-Synchron", assign_activate=0x0300, sync0_factor=1))
VALUES = {  # object → slot of the model, type, bits
    (0x6000, 0x11): (0, INTEGER16, 16),
    (0x6000, 0x12): (1, INTEGER16, 16),
    (0x6000, 0x13): (2, INTEGER16, 16),
    (0x6000, 0x20): (3, UNSIGNED8, 8),
    (0x6010, 0x13): (4, INTEGER16, 16),
}


def of_vendor(device: Device, vendor: int, product: int, revision: int = 0x10000) -> Device:
    """Return the device with another identity in its EEPROM."""
    image = device.sii_image()
    numbers = struct.pack("<3I", vendor, product, revision)
    written = image[:IDENTITY] + numbers + image[IDENTITY + len(numbers) :]
    device.sii_image = lambda: written  # type: ignore[method-assign]
    return device


class Imu(AppliedDevice):
    """Owns an inertial sensor: accelerations, a rate, a counter, two settings."""

    kind = "imu"

    def __init__(self) -> None:
        super().__init__(
            name="ACME IMU",
            alias=0,
            serial=0,
            lrw=True,
            crystal=EXACT,
            clock_bits=64,
            sii_quirks=NO_SII_QUIRKS,
            mailbox=MailboxOptions(MAILBOX_BYTES),
        )

    def description(self) -> Description:
        entries = tuple(
            MappedEntry(index, subindex, bits, f"value {slot}", kind)
            for (index, subindex), (slot, kind, bits) in VALUES.items()
        )
        pdos = (Pdo(0x1A00, "IMU", entries, 3),)
        return Description(
            name=self.name,
            order="IMU1F01",
            group="Sensors",
            product_code=0x1F01,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(MAILBOX_BYTES),
            sync_managers=sync_managers_of(MAILBOX_BYTES, (), pdos),
            fmmus=(1, 2, 3),
            rx_pdos=(),
            tx_pdos=pdos,
            clock=True,
            slots=len(VALUES),
            op_modes=SYNC0,
        )

    def sii_image(self) -> bytes:
        """Return its EEPROM with its OpModes, which only devices with axes have otherwise."""
        return make_sii_image(replace(self.whole_description(), axes=1))

    def add_objects(self, application: Application) -> None:
        add = application.dictionary.add
        for index in (0x6000, 0x6010):
            entries: dict[int, Entry] = {0: number("Number of entries", UNSIGNED8, 0x20)}
            for (at, subindex), (slot, kind, bits) in VALUES.items():
                if at == index:
                    name = f"value {slot}"
                    entries[subindex] = application.slot_entry(
                        name, kind, bits, slot, READ_ANY | MAP_TX
                    )
            add(index, "Values", entries)
        settings = {
            0x00: number("Number of entries", UNSIGNED8, 0x0B),
            0x06: stored("Low-pass", UNSIGNED16, b"\0\0"),
            0x0B: stored("Range", BOOLEAN, b"\0"),
        }
        add(0x8000, "Settings", settings)


def example_segment() -> Segment:
    """Return the line of shared/examples/machine.toml."""
    clocked = ServoQuirks(op_modes=SYNC0)

    def arm_drive(name: str, alias: int) -> Device:
        servo = Servo(name=name, alias=alias, counts_per_turn=524288, quirks=clocked)
        return of_vendor(servo, 0x9A, 0x30924, 0x10420)

    def wrist_drive(name: str, alias: int) -> Device:
        servo = Servo(name=name, alias=alias, axes=2, counts_per_turn=524288, quirks=clocked)
        return of_vendor(servo, 0x9A, 0x30928)

    return Segment(
        [
            of_vendor(Coupler(name="EK1100"), 0x2, 0x044C2C52),
            of_vendor(DigitalOutputs(name="EL2809", bits=16), 0x2, 0x0AF93052),
            of_vendor(Imu(), 0x5A5, 0x1F01, 0x10003),
            arm_drive("j1", 11),
            arm_drive("j2", 12),
            arm_drive("j3", 13),
            wrist_drive("wrist a", 14),
            wrist_drive("wrist b", 15),
            of_vendor(Servo(name="hand", alias=20, counts_per_turn=4096), 0x9A, 0x30924),
        ]
    )
