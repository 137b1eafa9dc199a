"""Layout of the process data: images, logical addresses, FMMUs, sync units. ETG.1000.4 §6.6.

- A unit is the content of one datagram (LRW; or LRD and LWR if a device has no LRW). A device is
  never split over units or datagrams (docs/reference/deviations.md): after the loss of one of two
  frames, its data would come from different cycles.
- An optional device is a separate unit, so its loss does not affect others. Devices with the same
  divider share units. The units of a divider are sent in different cycles, which keeps each cycle
  short.
- Inside a unit: the outputs of its devices, then their inputs, both by position.
- Every device starts at a new byte and fills whole bytes, even a terminal of four bits. Bit-wise
  FMMUs would save some bytes. However, a write would have to contain the neighbour's bits, not
  every ESC has bit-wise FMMUs, and mismatches as in SOEM#958 would occur. IgH also uses whole
  bytes.
- SyncManagers with adjacent memory share an FMMU, because terminals have few FMMUs.
- The control byte comes from the SII, except for the watchdog trigger of outputs. That bit is set
  if and only if the watchdog is on. Some SIIs have it clear, and Beckhoff's slave stack code
  answers 0x001F if the bit and the time contradict each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction
from catenary.plan.cycle import Number
from catenary.plan.numbers import (
    ANY,
    MappedNumber,
    MappedPdo,
    Which,
    find_number,
    mapped_pdos,
    numbers,
)
from catenary.wire.sync_manager import WATCHDOG_TRIGGER

LOGICAL_BASE = 0x0001_0000
LOGICAL_STRIDE = 0x0000_0800  # units start at multiples of it; no two share an FMMU's range
UNIT_MAX = 1472  # bytes of a unit: 1486 of a frame minus 14 of the AL status datagram
EXACT_UNIT_MAX = UNIT_MAX - 16  # with a cycle number in each frame


@dataclass(frozen=True, slots=True)
class SyncManagerPlan:
    """Planned configuration of one process-data SyncManager."""

    index: int
    direction: Direction
    start: int
    length: int  # bytes
    control: int

    @property
    def triggers_watchdog(self) -> bool:
        """True if a write triggers the process-data watchdog."""
        return bool(self.control & WATCHDOG_TRIGGER)


@dataclass(frozen=True, slots=True)
class FmmuPlan:
    """Mapping of whole bytes of the logical address space to physical memory."""

    index: int
    direction: Direction
    logical_start: int
    physical_start: int
    length: int


@dataclass(frozen=True, slots=True)
class MailboxFmmu:
    """FMMU that maps the mailbox-full bit of a device (mailboxes.py)."""

    index: int
    logical_bit: int  # bits from logical address 0


@dataclass(frozen=True, slots=True)
class DeviceLayout:
    """Place of one device's process data."""

    position: int
    sync_unit: int  # -1: no process data
    output_offset: int  # bytes, in the image of outputs
    output_size: int
    input_offset: int
    input_size: int
    sync_managers: tuple[SyncManagerPlan, ...] = ()
    fmmus: tuple[FmmuPlan, ...] = ()
    mailbox: MailboxFmmu | None = None


@dataclass(frozen=True, slots=True)
class UnitLayout:
    """Devices that share one datagram."""

    name: str
    devices: tuple[int, ...]
    optional: bool
    divider: int  # n: exchanged in every n-th cycle
    phase: int
    logical_read_write: bool
    logical_start: int
    output_offset: int  # in the image
    output_size: int
    input_offset: int
    input_size: int
    output_devices: int  # devices that add 1 to the counter of LWR, or 2 to that of LRW
    input_devices: int


@dataclass(frozen=True, slots=True)
class DeviceData:
    """Device and the process data chosen for it."""

    description: DeviceDescription
    outputs: tuple[Assignment, ...]
    inputs: tuple[Assignment, ...]
    divider: int = 1  # n: exchanged in every n-th cycle
    optional: bool = False
    watchdog_ns: int = 0  # watchdog time of process data; 0: off

    @property
    def position(self) -> int:
        return self.description.position

    @property
    def output_size(self) -> int:
        return sum(assignment.byte_length for assignment in self.outputs)

    @property
    def input_size(self) -> int:
        return sum(assignment.byte_length for assignment in self.inputs)

    @property
    def size(self) -> int:
        return self.output_size + self.input_size


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of the process data of all devices. Implements `plan.request.ImageLayout`."""

    units: tuple[UnitLayout, ...]
    devices: tuple[DeviceLayout, ...]
    output_size: int
    input_size: int
    outputs: tuple[tuple[MappedNumber, ...], ...]  # by position
    inputs: tuple[tuple[MappedNumber, ...], ...]
    output_pdos: tuple[tuple[MappedPdo, ...], ...]  # by position
    input_pdos: tuple[tuple[MappedPdo, ...], ...]

    def output(self, device: int, index: int, subindex: int, which: Which = ANY) -> Number | None:
        return find_number(self.outputs[device], index, subindex, which)

    def input(self, device: int, index: int, subindex: int, which: Which = ANY) -> Number | None:
        return find_number(self.inputs[device], index, subindex, which)

    def sync_unit(self, device: int) -> int:
        return self.devices[device].sync_unit

    def pdo_bits(self, device: int, direction: Direction, index: int) -> range | None:
        """Return the bits of a PDO in the image of a direction; None if it is not assigned."""
        pdos = (self.output_pdos, self.input_pdos)[direction][device]
        return next((pdo.bits for pdo in pdos if pdo.index == index), None)

    def byte_range(self, device: int, direction: Direction) -> range:
        """Return the bytes of a device in the image of a direction."""
        place = self.devices[device]
        if direction is Direction.OUTPUT:
            return range(place.output_offset, place.output_offset + place.output_size)
        return range(place.input_offset, place.input_offset + place.input_size)


def make_layout(devices: Sequence[DeviceData], unit_max: int = UNIT_MAX) -> Layout:
    """Return the layout of the process data of all devices.

    Args:
        devices: All devices, in the order of their positions.
        unit_max: Largest size of a unit [bytes].

    Raises:
        MappingError: The process data of a device does not fit into one unit.
        ConfigurationError: A device has too few FMMUs, or no SyncManager for its PDOs.
    """
    units: list[UnitLayout] = []
    places: dict[int, DeviceLayout] = {}
    output_offset = input_offset = 0
    logical_start = LOGICAL_BASE
    turns: dict[int, int] = {}  # divider → number of its units
    for members in _grouped(devices, unit_max):
        number = len(units)
        divider = members[0].divider
        turn = turns[divider] = turns.get(divider, -1) + 1
        unit = _unit(members, turn % divider, logical_start, output_offset, input_offset)
        units.append(unit)
        places.update(_places(members, unit, number))
        output_offset += unit.output_size
        input_offset += unit.input_size
        span = unit.output_size + unit.input_size
        logical_start += -(-span // LOGICAL_STRIDE) * LOGICAL_STRIDE
    ordered = tuple(
        places.get(data.position, DeviceLayout(data.position, -1, 0, 0, 0, 0)) for data in devices
    )
    both = tuple(zip(devices, ordered, strict=True))
    return Layout(
        tuple(units),
        ordered,
        output_offset,
        input_offset,
        tuple(numbers(data.outputs, place.output_offset) for data, place in both),
        tuple(numbers(data.inputs, place.input_offset) for data, place in both),
        tuple(mapped_pdos(data.outputs, place.output_offset) for data, place in both),
        tuple(mapped_pdos(data.inputs, place.input_offset) for data, place in both),
    )


def _grouped(devices: Sequence[DeviceData], unit_max: int) -> list[list[DeviceData]]:
    """Return the devices of each unit. Units are in the order of their first devices."""
    groups: list[list[DeviceData]] = []
    room: dict[
        tuple[bool, int], int
    ] = {}  # (LRW, divider) → rank of the group that is being filled
    for data in devices:
        if data.size == 0:
            continue
        if data.size > unit_max:
            raise MappingError(
                f"{data.description}: {data.output_size} bytes of outputs and {data.input_size} "
                f"bytes of inputs are {data.size} bytes; the process data of a device must fit "
                f"into one datagram of {unit_max} bytes",
                hint=f"map fewer objects, at least {data.size - unit_max} bytes less",
            )
        if data.optional:
            groups.append([data])
            continue
        kind = (data.description.supports_lrw, data.divider)
        rank = room.get(kind)
        if rank is not None and _fits(groups[rank], data, unit_max):
            groups[rank].append(data)
        else:
            room[kind] = len(groups)
            groups.append([data])
    return groups


def _fits(group: Sequence[DeviceData], data: DeviceData, unit_max: int) -> bool:
    return sum(member.size for member in group) + data.size <= unit_max


def _unit(
    members: Sequence[DeviceData],
    phase: int,
    logical_start: int,
    output_offset: int,
    input_offset: int,
) -> UnitLayout:
    positions = tuple(data.position for data in members)
    first, last = positions[0], positions[-1]
    name = f"device {first}" if first == last else f"devices {first} to {last}"
    return UnitLayout(
        name=name,
        devices=positions,
        optional=members[0].optional,
        divider=members[0].divider,
        phase=phase,
        logical_read_write=members[0].description.supports_lrw,
        logical_start=logical_start,
        output_offset=output_offset,
        output_size=sum(data.output_size for data in members),
        input_offset=input_offset,
        input_size=sum(data.input_size for data in members),
        output_devices=sum(data.output_size > 0 for data in members),
        input_devices=sum(data.input_size > 0 for data in members),
    )


def _places(
    members: Sequence[DeviceData], unit: UnitLayout, number: int
) -> dict[int, DeviceLayout]:
    places: dict[int, DeviceLayout] = {}
    output_offset = input_offset = 0  # inside the unit
    for data in members:
        managers = (
            *_managers(data, Direction.OUTPUT),
            *_managers(data, Direction.INPUT),
        )
        outputs_at = unit.logical_start + output_offset
        inputs_at = unit.logical_start + unit.output_size + input_offset
        places[data.position] = DeviceLayout(
            position=data.position,
            sync_unit=number,
            output_offset=unit.output_offset + output_offset,
            output_size=data.output_size,
            input_offset=unit.input_offset + input_offset,
            input_size=data.input_size,
            sync_managers=managers,
            fmmus=_fmmus(data.description, managers, outputs_at, inputs_at),
        )
        output_offset += data.output_size
        input_offset += data.input_size
    return places


def _managers(data: DeviceData, direction: Direction) -> tuple[SyncManagerPlan, ...]:
    device = data.description
    assignments = data.outputs if direction is Direction.OUTPUT else data.inputs
    channels = {channel.index: channel for channel in device.sync_managers}
    plans = []
    for assignment in assignments:
        if assignment.byte_length == 0:
            continue
        channel = channels.get(assignment.sync_manager)
        if channel is None or channel.use is not direction.use:
            raise ConfigurationError(
                f"{device}: its PDOs use SyncManager {assignment.sync_manager} for "
                f"{direction.noun}, but its SII does not define this SyncManager for them",
                hint="its SII is wrong; request a corrected image from the manufacturer",
            )
        plans.append(
            SyncManagerPlan(
                assignment.sync_manager,
                direction,
                channel.start,
                assignment.byte_length,
                _control(channel.control, direction, data.watchdog_ns),
            )
        )
    return tuple(plans)


def _control(byte: int, direction: Direction, watchdog_ns: int) -> int:
    """Return the control byte. For outputs, the trigger bit is set only if the watchdog is on."""
    if direction is Direction.INPUT:
        return byte
    return byte | WATCHDOG_TRIGGER if watchdog_ns else byte & ~WATCHDOG_TRIGGER


def _fmmus(
    device: DeviceDescription,
    managers: Sequence[SyncManagerPlan],
    outputs_at: int,
    inputs_at: int,
) -> tuple[FmmuPlan, ...]:
    """Return one FMMU per run of adjacent SyncManagers of a direction.

    Raises:
        ConfigurationError: The controller has too few FMMUs.
    """
    plans: list[FmmuPlan] = []
    next_logical = {Direction.OUTPUT: outputs_at, Direction.INPUT: inputs_at}
    for manager in managers:
        last = plans[-1] if plans else None
        logical = next_logical[manager.direction]
        next_logical[manager.direction] = logical + manager.length
        if (
            last is not None
            and last.direction is manager.direction
            and last.physical_start + last.length == manager.start
        ):
            plans[-1] = FmmuPlan(
                last.index,
                last.direction,
                last.logical_start,
                last.physical_start,
                last.length + manager.length,
            )
            continue
        plans.append(
            FmmuPlan(len(plans), manager.direction, logical, manager.start, manager.length)
        )
    if len(plans) > device.controller.fmmu_count:
        raise ConfigurationError(
            f"{device}: its process data needs {len(plans)} FMMUs, but its controller has "
            f"{device.controller.fmmu_count}",
            hint="use fewer SyncManagers",
        )
    return tuple(plans)
