"""Segments in TOML files.

A file contains `[[device]]` tables in the order of the line. It can also contain `[[fault]]`
tables, and a `[plant]` table for the motors.

ring = true

[[device]]
kind = "servo"
name = "shoulder"
alias = 10
counts_per_turn = 1048576
crystal = { ppm = 40.0, jitter = 20e-9 }

[[fault]]
kind = "power_cycle"
device = 2
at = 1.5
for = 0.8
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import msgspec

from catenary.errors import ConfigurationError
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import ClockBits, Crystal
from catenary.virtual.devices.analog_inputs import AnalogInputs, SecondPdo
from catenary.virtual.devices.coupler import Coupler
from catenary.virtual.devices.device import Device
from catenary.virtual.devices.digital_inputs import DigitalInputs
from catenary.virtual.devices.digital_outputs import DigitalOutputs
from catenary.virtual.devices.junction import Junction
from catenary.virtual.devices.servo import Servo
from catenary.virtual.devices.servo_quirks import NO_QUIRKS, ServoQuirks
from catenary.virtual.faults import Fault
from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.plant import STEP, Joint, Plant
from catenary.virtual.segment import ClockKind, Segment
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks
from catenary.virtual.wiring import Place


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


class _Table(
    msgspec.Struct, forbid_unknown_fields=True, tag_field="kind", frozen=True, kw_only=True
):
    name: str = ""
    alias: int = 0
    serial: int = 0
    behind: tuple[int, int] | None = None


class _ClockedTable(_Table, frozen=True, kw_only=True):
    crystal: CrystalTable = CrystalTable()
    clock_bits: ClockBits = 64


class _AppliedTable(_ClockedTable, frozen=True, kw_only=True):
    mailbox_bytes: int = 128
    mailbox_delay: float = 300e-6
    lrw: bool = True
    mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS
    sii_quirks: SiiQuirks = NO_SII_QUIRKS


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
    quirks: ServoQuirks = NO_QUIRKS
    mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS

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
            quirks=self.quirks,
            mapping_quirks=self.mapping_quirks,
            mailbox_quirks=self.mailbox_quirks,
            sii_quirks=self.sii_quirks,
        )


DeviceTable = (
    CouplerTable
    | JunctionTable
    | DigitalOutputsTable
    | DigitalInputsTable
    | AnalogInputsTable
    | ServoTable
)


class PlantTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    model: str
    joint: tuple[Joint, ...] | None = None
    passive: tuple[str, ...] = ()
    step: float = STEP
    contacts: bool = True

    def plant(self, path: str | Path) -> Plant:
        """Create the plant. The path of its model is relative to the folder of the file `path`."""
        return Plant(
            Path(path).parent / self.model,
            self.joint,
            passive=self.passive,
            step=self.step,
            contacts=self.contacts,
        )


class SegmentFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    device: tuple[DeviceTable, ...]
    plant: PlantTable | None = None
    fault: tuple[Fault, ...] = ()
    ring: bool = False
    link_loss_detection: float | Literal["enhanced", "standard"] = "enhanced"


OUT_OF_RANGE = (ArithmeticError, LookupError, ValueError, struct.error)
HINT = (
    "docs/reference/segment_file.md lists the fields of devices and plants, "
    "docs/how_to/faults.md those of faults"
)


@contextmanager
def _named(where: str) -> Iterator[None]:
    """Convert errors of constructors into a ConfigurationError that names the place in the file."""
    try:
        yield
    except OUT_OF_RANGE as error:
        raise ConfigurationError(f"{where}: {error}", hint=HINT) from error


def _device_in_fault(kind: type, given: Any) -> Any:
    """Create the device of `with = {kind = "servo", ...}` in a fault."""
    if kind is not Device:
        raise NotImplementedError
    try:
        return msgspec.convert(given, DeviceTable).device()
    except OUT_OF_RANGE as error:
        raise ValueError(str(error)) from error  # msgspec names the place


def _read(path: str | Path) -> SegmentFile:
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    try:
        file = msgspec.toml.decode(content, type=SegmentFile, dec_hook=_device_in_fault)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: {error}", hint=HINT) from error
    if not file.device:
        raise ConfigurationError(f"{path}: a segment needs at least one [[device]]")
    return file


def read_segment(path: str | Path, *, clock: ClockKind = "virtual", ring: bool = False) -> Segment:
    """Read a segment and its faults from a TOML file.

    Args:
        path: Path of the file.
        clock: See `Segment`.
        ring: True makes the segment a ring, regardless of the file.

    Raises:
        ConfigurationError: The file cannot be read or is invalid, or its plant cannot be simulated.
            The message names the file.
    """
    file = _read(path)
    devices = []
    for position, table in enumerate(file.device):
        with _named(f"{path}: device[{position}]"):
            devices.append(table.device())
    behind: dict[int, Place] = {
        position: table.behind
        for position, table in enumerate(file.device)
        if table.behind is not None
    }
    try:
        segment = Segment(
            devices,
            clock=clock,
            plant=None if file.plant is None else file.plant.plant(path),
            behind=behind,
            ring=ring or file.ring,
            link_loss_detection=file.link_loss_detection,
        )
    except OUT_OF_RANGE as error:
        raise ConfigurationError(f"{path}: {error}", hint=HINT) from error
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: plant: {error.message}", hint=error.hint) from error
    for number, fault in enumerate(file.fault):
        with _named(f"{path}: fault[{number}]"):
            segment.inject(fault)
    return segment
