"""Twin: a virtual device with the EEPROM, objects, PDO rules and clock of a real one.

Its CiA 402 axes move, as those of a `Servo`. Other outputs and inputs are objects.
`read_object` and `write_object` access them.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.virtual import _segment
from catenary.virtual.blueprint import Blueprint
from catenary.virtual.coe.dictionary import Abort, Entry, slot_value
from catenary.virtual.coe.object_facts import by_place
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MailboxDefault
from catenary.virtual.devices.application import Application
from catenary.virtual.devices.applied import MailboxOptions
from catenary.virtual.devices.described_dictionary import add_described
from catenary.virtual.devices.described_motors import (
    apply_option_quirks,
    motor_of,
    start_position,
)
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.motor_device import STEP_NS, MotorDevice
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks
from catenary.virtual.devices.synchronisation import Synchronisation
from catenary.virtual.devices.twin_objects import TwinObjects, layout_of
from catenary.virtual.foe.options import DeviceFiles
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.virtual.protocols import MailboxProtocol
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS

UPDATE_NS = 1_000_000  # interval between updates of the inputs of a device without axes
MINIMUM_CYCLE_NS = 10_000  # shortest cycle of SYNC pulses
MISSED_LIMIT = 3  # pulses without new outputs that are an error
STANDARD_MOTOR = Motor()
OF_THE_FILE = ("op_modes", "sync_signal", "watchdog_trigger")  # quirks that the SII determines
BOOTSTRAP_BYTE = 0x28  # words 0x14 to 0x17 of the EEPROM
REFUSES_COE = MailboxQuirks(error_reply="unsupported")


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinOptions:
    """Properties of a twin that its file does not give. ValueError if one contradicts the file.

    Args:
        motor: Motor of each CiA 402 axis, except for what the objects of the device tell; None: the
            axes do not move, and their objects only store values.
        modules: Modules in the slots of a modular device of an ESI; None: the default modules.
        mailbox_delay: Time until a request is answered [s].
        crystal: Frequency error and jitter of the clock.
        clock_bits: Width of the clock, 32 or 64.
        quirks: Differences of the axes from the profile. They have priority over the objects.
        mapping_quirks: Quirks of the PDOs, instead of what the file permits; None: as the file
            permits.
        mailbox_quirks: Quirks of the mailbox.
        files: Files that FoE reads and writes; None: the twin does not support FoE. It supports
            BOOT if its EEPROM has a bootstrap mailbox.
        protocols: Further mailbox protocols, whether or not the EEPROM names them.
    """

    motor: Motor | None = STANDARD_MOTOR
    modules: Sequence[str | int | None] | None = None
    mailbox_delay: float = 300e-6
    crystal: Crystal = EXACT
    clock_bits: ClockBits = 64
    quirks: ServoQuirks = NO_QUIRKS
    mapping_quirks: MappingQuirks | None = None
    mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    files: DeviceFiles | None = None
    protocols: Sequence[MailboxProtocol] = ()

    def __post_init__(self) -> None:
        for name in OF_THE_FILE:
            if getattr(self.quirks, name) != getattr(NO_QUIRKS, name):
                raise ValueError(f"quirk {name}: a twin has what its file gives; leave it out")


NO_OPTIONS = TwinOptions()


class Twin(MotorDevice):
    """Virtual device that is made from an SII, an ESI or a clone of a real device."""

    kind = "twin"

    def __init__(
        self,
        blueprint: Blueprint,
        *,
        name: str = "",
        options: TwinOptions = NO_OPTIONS,
    ) -> None:
        """Initialise the device.

        Args:
            blueprint: Facts of the device.
            name: Name in messages; empty: that of the SII or ESI.
            options: Properties that the file does not give.

        Raises:
            ValueError: A value is out of range.
        """
        found = blueprint.description
        self._blueprint = blueprint
        self._layout = layout_of(
            blueprint.objects, (*found.rx_pdos, *found.tx_pdos), moves=options.motor is not None
        )
        self._facts = by_place(blueprint.objects)
        motors = [
            motor_of(self._facts, each, options.motor or STANDARD_MOTOR) for each in self.offsets
        ]
        super().__init__(
            name=name or found.name,
            alias=found.alias,
            serial=found.serial,
            lrw=found.lrw,
            crystal=options.crystal,
            clock_bits=blueprint.clock_bits or options.clock_bits,
            sii_quirks=NO_SII_QUIRKS,
            mailbox=MailboxOptions(
                delay=options.mailbox_delay,
                quirks=options.mailbox_quirks if blueprint.serves_coe else REFUSES_COE,
                files=options.files,
                protocols=options.protocols,
            ),
        )
        self.install_motors(motors, options.quirks)
        self.mapping_quirks = options.mapping_quirks or found.mapping_quirks
        self.ports = blueprint.ports
        self._is_new = True

    @property
    def offsets(self) -> tuple[int, ...]:
        """Offset of the objects of each axis, such as 0x800 for the second one."""
        return self._layout.offsets

    def sii_image(self) -> bytes:
        """Return the content of the EEPROM."""
        return self._blueprint.image

    def description(self) -> Description:
        return replace(
            self._blueprint.description,
            name=self.name,
            slots=self._layout.count,
            axes=self.axes,
            mapping_quirks=self.mapping_quirks,
            loop_control=self.quirks.closes_ports,
        )

    def whole_description(self) -> Description:
        """Return the description with the bootstrap mailbox of the EEPROM."""
        found = super().whole_description()
        if self.files is None:
            return found
        receive, receive_size, send, send_size = struct.unpack_from(
            "<4H", self._blueprint.image, BOOTSTRAP_BYTE
        )
        box = MailboxDefault(receive, receive_size, send, send_size, coe_details=0)
        return replace(found, bootstrap=box if receive_size and send_size else None)

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        if self._layout.count and not self.axes:
            self.core.run_model(self.position, UPDATE_NS)
        self._restore_registers()
        if self._blueprint.description.emulation:
            self.application.map_process_data()
        if self._is_new:  # shafts keep their positions without power
            self._is_new = False
            self._place_shafts()

    def _restore_registers(self) -> None:
        if self._blueprint.information:
            self.core.poke(self.position, 0, self._blueprint.information)
        if self._blueprint.alias is not None:
            self.write_alias(self._blueprint.alias)

    def _place_shafts(self) -> None:
        for axis, offset in enumerate(self.offsets):
            counts = start_position(self._facts, offset)
            self.move_to(counts / self.motors[axis].counts_per_radian, axis)

    def add_objects(self, application: Application) -> None:
        description, exact = self._blueprint.description, self._blueprint.exact
        presets = {
            _segment.SLOTS_PER_AXIS * axis + slot: value
            for axis in range(self.axes)
            for slot, value in self.presets(axis).items()
        }
        objects = TwinObjects(
            self._blueprint.objects,
            description.rx_pdos,
            description.tx_pdos,
            self._layout,
            application.slot_entry,
            presets=presets,
            exact=exact,
        )
        add_described(application, objects.make(), exact=exact)
        for slot, value in objects.values.items():
            self.core.put_slot(self.position, slot, value)
        apply_option_quirks(application, self.offsets, self.quirks)
        application.checks_watchdog = self.quirks.checks_watchdog
        if description.clock and not description.emulation:
            application.synchronisation = self._synchronisation(application)

    def _synchronisation(self, application: Application) -> Synchronisation:
        return Synchronisation(
            self.core,
            self.position,
            application.dictionary,
            step_ns=STEP_NS if self.axes else UPDATE_NS,
            minimum_cycle_ns=MINIMUM_CYCLE_NS,
            copy_ns=0,
            missed_limit=MISSED_LIMIT,
            synchronous_type=None,
        )

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

        An axis that moves overwrites its own inputs, such as the statusword.

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
        value = slot_value(data, entry.bits, entry.signed)
        self.core.put_slot(self.position, entry.slot, value)
        self.core.refresh_inputs(self.position)

    def _entry(self, index: int, subindex: int) -> Entry:
        try:
            return self.application.dictionary.entry(index, subindex)
        except Abort:
            raise LookupError(f"{self.name}: no object 0x{index:04X}:{subindex:02X}") from None
