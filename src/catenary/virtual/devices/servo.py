"""Servo drive, CiA 402 (IEC 61800-7-201): modes PP, PV, homing, CSP, CSV and CST.

A drive has 1 to 8 axes. The objects of axis k have an offset of 0x800·k. The motor, its control
loops and the state machine are compiled (`servo.h`), and run in the internal cycle of the device.
Positions are in counts (`counts_per_turn`), velocities in counts per second, and torques in per
mille of the rated torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.virtual import _segment
from catenary.virtual.coe.diagnosis_history import (
    NO_HISTORY,
    DiagnosisHistory,
    HistoryOptions,
)
from catenary.virtual.coe.dictionary import (
    ARRAY,
    INTEGER8,
    INTEGER16,
    OUT_OF_RANGE,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    Abort,
    Dictionary,
    Entry,
    number,
)
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import MailboxOptions
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.motor_device import STEP_NS, MotorDevice
from catenary.virtual.devices.servo_homing import add_homing
from catenary.virtual.devices.servo_objects import (
    BITS,
    DEFAULT_RX,
    DEFAULT_TX,
    OBJECT_BY_INDEX,
    OBJECTS,
    RW,
    RX,
    AxisObject,
)
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks
from catenary.virtual.devices.synchronisation import DC_SYNC0, DC_SYNC1, Synchronisation
from catenary.virtual.devices.touch_probe import ProbeOptions, add_touch_probes
from catenary.virtual.foe.options import DeviceFiles
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.protocols import MailboxProtocol
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

MINIMUM_CYCLE_NS = 62_500  # shortest SYNC0 cycle
COPY_NS = 20_000  # minimum time from the arrival of outputs to SYNC0
SUPPORTED_MODES = {0, 1, 3, 6, 8, 9, 10}
SUPPORTED_MODES_MASK = sum(1 << mode - 1 for mode in SUPPORTED_MODES - {0})  # 0x6502
AXIS_STRIDE, PDO_STRIDE = 0x800, 0x10


def _pdo(index: int, name: str, objects: tuple[int, ...], axis: int, sync_manager: int) -> Pdo:
    entries = tuple(
        MappedEntry(
            o + AXIS_STRIDE * axis,
            0,
            BITS[OBJECT_BY_INDEX[o].data_type],
            OBJECT_BY_INDEX[o].name,
            OBJECT_BY_INDEX[o].data_type,
        )
        for o in objects
    )
    return Pdo(index + PDO_STRIDE * axis, name, entries, sync_manager)


class Servo(MotorDevice):
    """Servo drive with 1 to 8 axes and their motors."""

    kind = "servo"

    def __init__(
        self,
        *,
        name: str = "Catenary virtual servo",
        alias: int = 0,
        serial: int = 0,
        axes: int = 1,
        counts_per_turn: int = 1 << 20,
        velocity_counts_per_turn: int | None = None,
        inertia: float = 5e-4,
        viscous_friction: float = 1e-3,
        coulomb_friction: float = 0.02,
        rated_torque: float = 2.0,
        max_torque_ratio: float = 3.0,
        max_velocity: float = 350.0,
        following_error_turns: float = 0.25,
        position_limits: tuple[float, float] | None = None,
        mailbox_bytes: int = 128,
        mailbox_delay: float = 300e-6,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        lrw: bool = True,
        sync_missed_limit: int = 3,
        touch_probe: ProbeOptions | None = None,
        diagnosis: HistoryOptions = NO_HISTORY,
        quirks: ServoQuirks = NO_QUIRKS,
        mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS,
        mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        sii_quirks: SiiQuirks = NO_SII_QUIRKS,
        files: DeviceFiles | None = None,
        protocols: Sequence[MailboxProtocol] = (),
    ) -> None:
        """Initialise the drive.

        Args:
            name: Device name.
            alias: Station alias.
            serial: Serial number.
            axes: Number of axes, 1 to 8.
            counts_per_turn: Position counts per turn of the motor.
            velocity_counts_per_turn: Value of 0x606C and 0x60FF at one turn per second; None:
                `counts_per_turn`.
            inertia: Motor inertia [kg·m²].
            viscous_friction: Viscous friction [N·m·s/rad].
            coulomb_friction: Dry friction [N·m].
            rated_torque: Rated torque [N·m].
            max_torque_ratio: Maximum torque divided by rated torque.
            max_velocity: Maximum velocity [rad/s].
            following_error_turns: Following error window [turns].
            position_limits: Software position limits (minimum, maximum) [rad]; None: no limits.
            mailbox_bytes: Size of each mailbox [bytes].
            mailbox_delay: Time until a request is answered [s].
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64.
            lrw: True if the device supports LRW.
            sync_missed_limit: Number of consecutive SYNC pulses without new outputs after which
                the drive reports a fault.
            touch_probe: Touch probes of each axis (0x60B8); None: it has none.
            diagnosis: Form of the diagnosis history (0x10F3); the default has none.
            quirks: Differences of the drive from the profile.
            mapping_quirks: Quirks of the PDOs.
            mailbox_quirks: Quirks of the mailbox.
            sii_quirks: Quirks of the SII.
            files: Files that FoE reads and writes; None: the device does not support FoE.
            protocols: Further mailbox protocols of the device.

        Raises:
            ValueError: A value is out of range.
        """
        if not 1 <= axes <= _segment.AXES_MAX:
            raise ValueError(f"axes must be 1 to {_segment.AXES_MAX}, not {axes}")
        if not 1 <= sync_missed_limit <= 0xFFFF:
            raise ValueError(f"sync_missed_limit must be 1 to 65535, not {sync_missed_limit}")
        motor = Motor(
            counts_per_turn=counts_per_turn,
            velocity_counts_per_turn=velocity_counts_per_turn,
            inertia=inertia,
            viscous_friction=viscous_friction,
            coulomb_friction=coulomb_friction,
            rated_torque=rated_torque,
            max_torque_ratio=max_torque_ratio,
            max_velocity=max_velocity,
            following_error_turns=following_error_turns,
            position_limits=position_limits,
        )
        super().__init__(
            name=name,
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=sii_quirks,
            mailbox=MailboxOptions(mailbox_bytes, mailbox_delay, mailbox_quirks, files, protocols),
        )
        self.install_motors([motor] * axes, quirks)
        self.touch_probe = touch_probe
        self.counts_per_turn = counts_per_turn
        self.velocity_counts_per_turn = motor.velocity_counts
        self.inertia = inertia
        self.viscous_friction = viscous_friction
        self.coulomb_friction = coulomb_friction
        self.rated_torque = rated_torque
        self.max_torque_ratio = max_torque_ratio
        self.max_velocity = max_velocity
        self.following_error_turns = following_error_turns
        self.position_limits = position_limits
        self.sync_missed_limit = sync_missed_limit
        self.diagnosis = diagnosis
        self.mapping_quirks = mapping_quirks

    def _pdos(
        self, base: int, default: tuple[int, ...], others: tuple[tuple[int, ...], ...]
    ) -> list[Pdo]:
        pdos = []
        sync_manager = 2 if base < 0x1A00 else 3
        kind = "RxPDO" if base < 0x1A00 else "TxPDO"
        for axis in range(self.axes):
            name = f"Axis {axis + 1} {kind}"
            pdos.append(_pdo(base, name, default, axis, sync_manager))
            for k, objects in enumerate(others, 1):
                pdos.append(_pdo(base + k, f"{name} {k + 1}", objects, axis, 0xFF))
        return pdos

    def description(self) -> Description:
        rx = self._pdos(0x1600, DEFAULT_RX, ((0x6040, 0x607A), (0x6040, 0x60FF), (0x6040, 0x6071)))
        tx = self._pdos(0x1A00, DEFAULT_TX, ((0x6041, 0x6064), (0x60F4,), (0x60FD, 0x603F)))
        return Description(
            name=self.name,
            order=f"CVS{self.axes:03d}",
            group="Servo drives",
            product_code=0x0005_0000 + self.axes,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes, self.mapping_quirks.coe_details),
            sync_managers=sync_managers_of(
                self.mailbox_bytes, rx, tx, watchdog_trigger=self.quirks.watchdog_trigger
            ),
            fmmus=(1, 2, 3),
            rx_pdos=tuple(rx),
            tx_pdos=tuple(tx),
            clock=True,
            axes=self.axes,
            slots=self.axes * _segment.SLOTS_PER_AXIS,
            mapping_quirks=self.mapping_quirks,
            op_modes=self.quirks.op_modes,
            loop_control=self.quirks.closes_ports,
            lrw=self.lrw,
        )

    def add_objects(self, application: Application) -> None:
        application.synchronisation = Synchronisation(
            self.core,
            self.position,
            application.dictionary,
            step_ns=STEP_NS,
            minimum_cycle_ns=MINIMUM_CYCLE_NS,
            copy_ns=COPY_NS,
            missed_limit=self.sync_missed_limit,
            synchronous_type=DC_SYNC1 if self.quirks.sync_signal == "sync1" else DC_SYNC0,
        )
        application.checks_watchdog = self.quirks.checks_watchdog
        if self.diagnosis.messages:
            application.history = DiagnosisHistory(
                application.dictionary, lambda: self.core.now, self.diagnosis
            )
        for axis in range(self.axes):
            self._add_axis(application, axis)

    def _add_axis(self, application: Application, axis: int) -> None:
        base, slots = AXIS_STRIDE * axis, _segment.SLOTS_PER_AXIS * axis
        dictionary = application.dictionary
        for o in OBJECTS:
            if o.index == 0x605A and self.quirks.quick_stop_option == "absent":
                continue
            entry = application.slot_entry(
                o.name, o.data_type, BITS[o.data_type], slots + o.slot, o.access
            )
            if o.index == 0x6060:
                entry = self._checked_mode(entry)
            dictionary.add_variable(o.index + base, entry)

        def slot(name: str, data_type: int, number_of_slot: int, access: int) -> Entry:
            return application.slot_entry(
                name, data_type, BITS[data_type], slots + number_of_slot, access
            )

        limits = [
            slot("Min position limit", 4, _segment.SLOT_LIMIT_MIN, RW),
            slot("Max position limit", 4, _segment.SLOT_LIMIT_MAX, RW),
        ]
        dictionary.add_record(0x607D + base, "Software position limit", limits, code=ARRAY)
        add_homing(dictionary, base, slot)
        if self.touch_probe is not None:

            def variable(each: AxisObject) -> Entry:
                return slot(each.name, each.data_type, each.slot, each.access)

            add_touch_probes(self.touch_probe, dictionary, base, variable, slot)
        interpolation = [
            slot(
                "Interpolation time period value", UNSIGNED8, _segment.SLOT_INTERPOLATION_PERIOD, RW
            ),
            slot("Interpolation time index", INTEGER8, _segment.SLOT_INTERPOLATION_EXPONENT, RW),
        ]
        dictionary.add_record(0x60C2 + base, "Interpolation time period", interpolation)
        outputs = slot("Physical outputs", UNSIGNED32, _segment.SLOT_DIGITAL_OUTPUTS, RX)
        dictionary.add_record(0x60FE + base, "Digital outputs", [outputs], code=ARRAY)
        self._add_constants(dictionary, base)

    def _add_constants(self, dictionary: Dictionary, base: int) -> None:
        """Add the objects of an axis that never change."""
        torque = round(self.rated_torque * 1000)
        dictionary.add_variable(0x6075 + base, number("Motor rated current", UNSIGNED32, 1000))
        dictionary.add_variable(0x6076 + base, number("Motor rated torque", UNSIGNED32, torque))
        modes = number("Supported drive modes", UNSIGNED32, SUPPORTED_MODES_MASK)
        dictionary.add_variable(0x6502 + base, modes)
        trapezoid = number("Motion profile type", INTEGER16, 0)
        dictionary.add_variable(0x6086 + base, trapezoid)
        encoder = [
            number("Encoder increments", UNSIGNED32, self.counts_per_turn),
            number("Motor revolutions", UNSIGNED32, 1),
        ]
        dictionary.add_record(0x608F + base, "Position encoder resolution", encoder, code=ARRAY)
        velocity = [
            number("Encoder increments per second", UNSIGNED32, self.velocity_counts_per_turn),
            number("Motor revolutions per second", UNSIGNED32, 1),
        ]
        dictionary.add_record(0x6090 + base, "Velocity encoder resolution", velocity, code=ARRAY)
        number_of_type = number("Motor type", UNSIGNED16, 0x0003)  # PM synchronous motor
        dictionary.add_variable(0x6402 + base, number_of_type)

    @staticmethod
    def _checked_mode(entry: Entry) -> Entry:
        write = entry.write

        def checked(data: bytes) -> None:
            if data[0] not in SUPPORTED_MODES:
                raise Abort(OUT_OF_RANGE)
            if write is not None:
                write(data)

        return replace(entry, write=checked)
