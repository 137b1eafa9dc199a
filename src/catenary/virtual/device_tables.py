"""Tables of the devices in a segment file. Each table creates its device."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from catenary.virtual.aoe.protocol import Ads
from catenary.virtual.coe.diagnosis_history import NO_HISTORY, HistoryOptions
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import ClockBits, Crystal
from catenary.virtual.devices.analog_inputs import AnalogInputs, SecondPdo
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.described import DescribedDevice, esi_device
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_inputs import DigitalInputs
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.junction import Junction
from catenary.virtual.devices.model_sensor import ModelSensor
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.oversampling import OversamplingTerminal
from catenary.virtual.devices.servo import Servo
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks
from catenary.virtual.devices.touch_probe import ProbeOptions
from catenary.virtual.devices.twin import STANDARD_MOTOR, TwinOptions
from catenary.virtual.eoe.ethernet import Ethernet
from catenary.virtual.foe.options import DeviceFiles
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.protocols import MailboxProtocol
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks
from catenary.virtual.vendor_protocol import VendorEcho


class CrystalTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    ppm: float = 0.0
    drift_ppm: float = 0.0
    drift_period: float = 600.0
    jitter: float = 0.0

    def crystal(self) -> Crystal:
        return Crystal(
            ppm=self.ppm,
            drift_ppm=self.drift_ppm,
            drift_period=self.drift_period,
            jitter=self.jitter,
        )


class _PlacedTable(
    msgspec.Struct, forbid_unknown_fields=True, tag_field="kind", frozen=True, kw_only=True
):
    name: str = ""
    behind: tuple[int, int] | None = None


class _Table(_PlacedTable, frozen=True, kw_only=True):
    alias: int = 0
    serial: int = 0


class _ClockedTable(_Table, frozen=True, kw_only=True):
    crystal: CrystalTable = CrystalTable()
    clock_bits: ClockBits = 64


class _AppliedTable(_ClockedTable, frozen=True, kw_only=True):
    mailbox_bytes: int = 128
    mailbox_delay: float = 300e-6
    lrw: bool = True
    mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    sii_quirks: SiiQuirks = NO_SII_QUIRKS


def _given(*protocols: MailboxProtocol | None) -> tuple[MailboxProtocol, ...]:
    """Return the mailbox protocols that a table has."""
    return tuple(each for each in protocols if each is not None)


class CouplerTable(_ClockedTable, tag="coupler", frozen=True, kw_only=True):
    def device(self) -> Device:
        return Coupler(
            name=self.name or "Catenary virtual coupler",
            alias=self.alias,
            serial=self.serial,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
        )


class JunctionTable(_Table, tag="junction", frozen=True, kw_only=True):
    port_count: int = 4

    def device(self) -> Device:
        return Junction(
            name=self.name, alias=self.alias, serial=self.serial, port_count=self.port_count
        )


class DigitalOutputsTable(_ClockedTable, tag="digital_outputs", frozen=True, kw_only=True):
    bits: int = 4
    lrw: bool = True
    dc: bool = False

    def device(self) -> Device:
        return DigitalOutputs(
            bits=self.bits,
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            lrw=self.lrw,
            dc=self.dc,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
        )


class DigitalInputsTable(_Table, tag="digital_inputs", frozen=True, kw_only=True):
    bits: int = 4
    lrw: bool = True

    def device(self) -> Device:
        return DigitalInputs(
            bits=self.bits, name=self.name, alias=self.alias, serial=self.serial, lrw=self.lrw
        )


class AnalogInputsTable(_AppliedTable, tag="analog_inputs", frozen=True, kw_only=True):
    channels: int = 2
    second_pdo: SecondPdo = "none"
    mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS
    files: DeviceFiles | None = None
    ethernet: Ethernet | None = None
    ads: Ads | None = None
    vendor_echo: VendorEcho | None = None

    def device(self) -> Device:
        return AnalogInputs(
            channels=self.channels,
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            mailbox_bytes=self.mailbox_bytes,
            mailbox_delay=self.mailbox_delay,
            lrw=self.lrw,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
            second_pdo=self.second_pdo,
            mapping_quirks=self.mapping_quirks,
            mailbox_quirks=self.mailbox_quirks,
            sii_quirks=self.sii_quirks,
            files=self.files,
            protocols=_given(self.ethernet, self.ads, self.vendor_echo),
        )


class OversamplingTable(_ClockedTable, tag="oversampling", frozen=True, kw_only=True):
    direction: Literal["inputs", "outputs"] = "inputs"
    channels: int = 2
    samples: int = 10
    lrw: bool = True

    def device(self) -> Device:
        return OversamplingTerminal(
            direction=self.direction,
            channels=self.channels,
            samples=self.samples,
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            lrw=self.lrw,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
        )


class ModelSensorTable(_AppliedTable, tag="model_sensor", frozen=True, kw_only=True):
    sensors: tuple[str, ...]
    noise: dict[str, float] = {}
    bias: dict[str, float] = {}
    scale: dict[str, float] = {}
    seed: int = 0

    def device(self) -> Device:
        return ModelSensor(
            sensors=self.sensors,
            noise=self.noise,
            bias=self.bias,
            scale=self.scale,
            seed=self.seed,
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            mailbox_bytes=self.mailbox_bytes,
            mailbox_delay=self.mailbox_delay,
            lrw=self.lrw,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
            mailbox_quirks=self.mailbox_quirks,
            sii_quirks=self.sii_quirks,
        )


class ServoTable(_AppliedTable, tag="servo", frozen=True, kw_only=True):
    axes: int = 1
    counts_per_turn: int = 1 << 20
    velocity_counts_per_turn: int | None = None
    inertia: float = 5e-4
    viscous_friction: float = 1e-3
    coulomb_friction: float = 0.02
    rated_torque: float = 2.0
    max_torque_ratio: float = 3.0
    max_velocity: float = 350.0
    following_error_turns: float = 0.25
    position_limits: tuple[float, float] | None = None
    sync_missed_limit: int = 3
    touch_probe: ProbeOptions | None = None
    diagnosis: HistoryOptions = NO_HISTORY
    quirks: ServoQuirks = NO_QUIRKS
    mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS
    files: DeviceFiles | None = None
    ethernet: Ethernet | None = None
    ads: Ads | None = None
    vendor_echo: VendorEcho | None = None

    def device(self) -> Device:
        return Servo(
            name=self.name or "Catenary virtual servo",
            alias=self.alias,
            serial=self.serial,
            axes=self.axes,
            counts_per_turn=self.counts_per_turn,
            velocity_counts_per_turn=self.velocity_counts_per_turn,
            inertia=self.inertia,
            viscous_friction=self.viscous_friction,
            coulomb_friction=self.coulomb_friction,
            rated_torque=self.rated_torque,
            max_torque_ratio=self.max_torque_ratio,
            max_velocity=self.max_velocity,
            following_error_turns=self.following_error_turns,
            position_limits=self.position_limits,
            mailbox_bytes=self.mailbox_bytes,
            mailbox_delay=self.mailbox_delay,
            lrw=self.lrw,
            crystal=self.crystal.crystal(),
            clock_bits=self.clock_bits,
            sync_missed_limit=self.sync_missed_limit,
            touch_probe=self.touch_probe,
            diagnosis=self.diagnosis,
            quirks=self.quirks,
            mapping_quirks=self.mapping_quirks,
            mailbox_quirks=self.mailbox_quirks,
            sii_quirks=self.sii_quirks,
            files=self.files,
            protocols=_given(self.ethernet, self.ads, self.vendor_echo),
        )


class EsiTable(_ClockedTable, tag="esi", frozen=True, kw_only=True):
    esi: str  # relative to the folder of the segment file
    chosen: str = msgspec.field(default="", name="device")
    mailbox_delay: float = 300e-6
    mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    mapping_quirks: MappingQuirks | None = None
    quirks: ServoQuirks = NO_QUIRKS
    motor: Motor = STANDARD_MOTOR
    files: DeviceFiles | None = None
    ethernet: Ethernet | None = None
    ads: Ads | None = None
    vendor_echo: VendorEcho | None = None
    modules: tuple[str | int, ...] | None = None  # "" for an empty slot

    def device(self) -> Device:
        return DescribedDevice(
            esi_device(self.esi, self.chosen),
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            options=TwinOptions(
                motor=self.motor,
                modules=self.modules,
                mailbox_delay=self.mailbox_delay,
                crystal=self.crystal.crystal(),
                clock_bits=self.clock_bits,
                quirks=self.quirks,
                mapping_quirks=self.mapping_quirks,
                mailbox_quirks=self.mailbox_quirks,
                files=self.files,
                protocols=_given(self.ethernet, self.ads, self.vendor_echo),
            ),
        )


class SiiTable(_PlacedTable, tag="sii", frozen=True, kw_only=True):
    sii: str  # relative to the folder of the segment file
    alias: int | None = None  # that of the image
    serial: int | None = None
    clock: bool | None = None
    crystal: CrystalTable = CrystalTable()
    clock_bits: ClockBits = 64
    mailbox_delay: float = 300e-6
    mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    mapping_quirks: MappingQuirks | None = None
    quirks: ServoQuirks = NO_QUIRKS
    motor: Motor = STANDARD_MOTOR
    files: DeviceFiles | None = None
    ethernet: Ethernet | None = None
    ads: Ads | None = None
    vendor_echo: VendorEcho | None = None

    def device(self) -> Device:
        return Device.from_sii(
            self.sii,
            name=self.name,
            alias=self.alias,
            serial=self.serial,
            clock=self.clock,
            options=TwinOptions(
                motor=self.motor,
                mailbox_delay=self.mailbox_delay,
                crystal=self.crystal.crystal(),
                clock_bits=self.clock_bits,
                quirks=self.quirks,
                mapping_quirks=self.mapping_quirks,
                mailbox_quirks=self.mailbox_quirks,
                files=self.files,
                protocols=_given(self.ethernet, self.ads, self.vendor_echo),
            ),
        )


DeviceTable = (
    CouplerTable
    | JunctionTable
    | DigitalOutputsTable
    | DigitalInputsTable
    | AnalogInputsTable
    | ModelSensorTable
    | OversamplingTable
    | ServoTable
    | EsiTable
    | SiiTable
)


def located(table: DeviceTable, folder: Path) -> DeviceTable:
    """Return the table with the path of its ESI or SII, if it has one.

    Args:
        table: The table, with a path that is relative to the segment file.
        folder: Folder of the segment file.
    """
    if isinstance(table, EsiTable):
        return msgspec.structs.replace(table, esi=str(folder / table.esi))
    if isinstance(table, SiiTable):
        return msgspec.structs.replace(table, sii=str(folder / table.sii))
    return table
