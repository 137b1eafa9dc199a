"""Analogue input terminal with CoE. 0x60n0:11 is the value, preceded by status bits.

Real terminals use the same layout.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from catenary.virtual.coe.dictionary import (
    BOOLEAN,
    INTEGER8,
    INTEGER16,
    MAP_TX,
    READ_ANY,
    UNSIGNED8,
    Entry,
    number,
    stored,
)
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import AppliedDevice, MailboxOptions
from catenary.virtual.foe.options import DeviceFiles
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.protocols import MailboxProtocol
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

SLOTS = 4  # per channel: underrange, overrange, error, value
UNDERRANGE, OVERRANGE, ERROR, VALUE = range(SLOTS)
FULL_SCALE = 0x7FFF
CONVERSION_NS = 500_000

SecondPdo = Literal["none", "compact", "twice"]


class AnalogInputs(AppliedDevice):
    """Terminal with 1 to 8 analogue inputs of ±10 V and 16 bits."""

    kind = "analog_inputs"

    def __init__(
        self,
        *,
        channels: int = 2,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
        mailbox_bytes: int = 128,
        mailbox_delay: float = 300e-6,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        second_pdo: SecondPdo = "none",
        mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS,
        mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        sii_quirks: SiiQuirks = NO_SII_QUIRKS,
        files: DeviceFiles | None = None,
        protocols: Sequence[MailboxProtocol] = (),
    ) -> None:
        """Initialise the terminal.

        Args:
            channels: Number of channels, 1 to 8.
            name: Device name; empty: a default name.
            alias: Station alias.
            serial: Serial number.
            lrw: True if the device supports LRW.
            mailbox_bytes: Size of each mailbox [bytes].
            mailbox_delay: Time until a request is answered [s].
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64.
            second_pdo: Second PDO of each channel, from 0x1A10 on. "compact": it contains only the
                value and is not assigned, as in Beckhoff's EL30xx. "twice": it is also assigned,
                with a value of 8 bits; the EL3632 maps 0x6000:02 twice with different sizes.
            mapping_quirks: Quirks of the PDOs.
            mailbox_quirks: Quirks of the mailbox.
            sii_quirks: Quirks of the SII.
            files: Files that FoE reads and writes; None: the device does not support FoE.
            protocols: Further mailbox protocols of the device.

        Raises:
            ValueError: A value is out of range.
        """
        if not 1 <= channels <= 8:
            raise ValueError(f"channels must be 1 to 8, not {channels}")
        super().__init__(
            name=name or f"Catenary virtual {channels}-channel analogue input",
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=sii_quirks,
            mailbox=MailboxOptions(mailbox_bytes, mailbox_delay, mailbox_quirks, files, protocols),
        )
        self.channels = channels
        self.second_pdo = second_pdo
        self.mapping_quirks = mapping_quirks

    def _second(self, channel: int) -> Pdo:
        index, twice = 0x6000 + 0x10 * channel, self.second_pdo == "twice"
        value = (8, "Value", INTEGER8) if twice else (16, "Value", INTEGER16)
        name = f"AI compact channel {channel + 1}"
        entries = (MappedEntry(index, 0x11, *value),)
        return Pdo(0x1A10 + channel, name, entries, 3 if twice else 0xFF)

    def _pdo(self, channel: int) -> Pdo:
        index = 0x6000 + 0x10 * channel
        entries = (
            MappedEntry(index, 0x01, 1, "Underrange", BOOLEAN),
            MappedEntry(index, 0x02, 1, "Overrange", BOOLEAN),
            MappedEntry(0, 0, 4, "", 0),
            MappedEntry(index, 0x07, 1, "Error", BOOLEAN),
            MappedEntry(0, 0, 9, "", 0),
            MappedEntry(index, 0x11, 16, "Value", INTEGER16),
        )
        return Pdo(0x1A00 + channel, f"AI channel {channel + 1}", entries, 3)

    def description(self) -> Description:
        pdos = tuple(self._pdo(k) for k in range(self.channels))
        if self.second_pdo != "none":
            pdos += tuple(self._second(k) for k in range(self.channels))
        return Description(
            name=self.name,
            order=f"CVA{self.channels:03d}",
            group="Analogue inputs",
            product_code=0x0004_0000 + self.channels,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes, self.mapping_quirks.coe_details),
            sync_managers=sync_managers_of(self.mailbox_bytes, (), pdos),
            fmmus=(1, 2, 3),
            rx_pdos=(),
            tx_pdos=pdos,
            clock=True,
            slots=SLOTS * self.channels,
            current_milliampere=130,
            mapping_quirks=self.mapping_quirks,
            lrw=self.lrw,
        )

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        self.core.run_model(self.position, CONVERSION_NS)

    def add_objects(self, application: Application) -> None:
        readable = READ_ANY | MAP_TX
        for k in range(self.channels):
            at = SLOTS * k
            entries: dict[int, Entry] = {
                0x00: number("Number of entries", UNSIGNED8, 0x11),
                0x01: application.slot_entry("Underrange", BOOLEAN, 1, at + UNDERRANGE, readable),
                0x02: application.slot_entry("Overrange", BOOLEAN, 1, at + OVERRANGE, readable),
                0x07: application.slot_entry("Error", BOOLEAN, 1, at + ERROR, readable),
                0x11: application.slot_entry("Value", INTEGER16, 16, at + VALUE, readable),
            }
            application.dictionary.add(0x6000 + 0x10 * k, f"AI inputs channel {k + 1}", entries)
            filter_setting = stored("Filter", UNSIGNED8, b"\0")
            application.dictionary.add_record(
                0x8000 + 0x10 * k, f"AI settings channel {k + 1}", [filter_setting]
            )

    def apply_volts(self, channel: int, volts: float) -> None:
        """Apply a voltage to one channel.

        A voltage out of range is clamped and sets the error bit and a range bit.

        Args:
            channel: Channel number, from 0.
            volts: Voltage [V]; full scale is ±10 V.

        Raises:
            IndexError: The channel does not exist.
            ValueError: The device is not in a segment.
        """
        if not 0 <= channel < self.channels:
            raise IndexError(f"channel must be 0 to {self.channels - 1}, not {channel}")
        raw = round(volts / 10 * FULL_SCALE)
        clamped = max(-FULL_SCALE - 1, min(FULL_SCALE, raw))
        at = SLOTS * channel
        for slot, value in (
            (VALUE, clamped),
            (UNDERRANGE, int(raw < clamped)),
            (OVERRANGE, int(raw > clamped)),
            (ERROR, int(raw != clamped)),
        ):
            self.core.put_slot(self.position, at + slot, value)
        self.core.refresh_inputs(self.position)

    def volts(self, channel: int) -> float:
        """Return the measured voltage of a channel [V]."""
        return self.core.slot(self.position, SLOTS * channel + VALUE) / FULL_SCALE * 10
