"""Slaves of the published interface: raw objects, a CiA 402 servo, inputs and outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from catenary.errors import ConfigurationError, DriveError, MappingError
from catenary.model.device import DeviceDescription, Direction, mapped_entries
from catenary.plan.cycle import Bank, Column, NumberKind
from catenary.plan.numbers import Which
from catenary.plan.request import DeviceRequest, ImageLayout, ObjectReference, RequestTables
from catenary.wire.cia402 import AxisState, Mode, Object, state_of

COMMANDS = {
    AxisState.SWITCH_ON_DISABLED: 0x06,  # shutdown
    AxisState.READY_TO_SWITCH_ON: 0x07,  # switch on
    AxisState.SWITCHED_ON: 0x0F,  # enable operation
    AxisState.OPERATION_ENABLED: 0x0F,
    AxisState.FAULT: 0x80,  # fault reset
}


class Cell(Protocol):
    """A mapped object in the process data of the running master."""

    def read(self) -> int: ...
    def write(self, value: int) -> None: ...


@dataclass(frozen=True, slots=True)
class RawObject:
    """An object that a slave exchanges."""

    index: int
    subindex: int
    bit_length: int
    direction: Direction
    signed: bool = False
    required: bool = True

    @property
    def place(self) -> tuple[int, int]:
        return self.index, self.subindex


class SlaveBase:
    """Process data of one slave as raw integers: `read(0x6041)`, `write(0x6040, 15)`.

    Args:
        position: Position of the slave, from 0.
        vendor: Required vendor; None accepts any.
        product: Required product; None accepts any.
        objects: The objects to exchange.
    """

    def __init__(
        self,
        position: int,
        vendor: int | None = None,
        product: int | None = None,
        objects: Sequence[RawObject] = (),
    ) -> None:
        self.position = position
        self.vendor = vendor
        self.product = product
        self.objects = tuple(objects)
        self.start_up: tuple[tuple[int, int, bytes], ...] = ()
        self._cells: Mapping[tuple[int, int], Cell] = {}

    def adopt(self, description: DeviceDescription) -> None:
        """Check the identity of the device that was found.

        Raises:
            ConfigurationError: Vendor or product differ from the expected ones.
        """
        found = description.identity
        for expected, actual in ((self.vendor, found.vendor), (self.product, found.product)):
            if expected is not None and expected != actual:
                raise ConfigurationError(
                    f"{description}: vendor and product {found.vendor:#x}, {found.product:#x} are "
                    f"not the expected {self.vendor}, {self.product}",
                    hint="correct the position, or connect the expected device",
                )

    def bind(self, cells: Mapping[tuple[int, int], Cell]) -> None:
        """Set the cells of the mapped objects. Without an active master, there are no cells."""
        self._cells = cells

    def read(self, index: int, subindex: int = 0) -> int:
        """Return the value of a mapped object at the last `ecat_domain_process`.

        Args:
            index: Index of the object.
            subindex: Subindex of the object.

        Raises:
            MappingError: The object is not mapped.
        """
        return self._cell(index, subindex).read()

    def write(self, index: int, value: int, subindex: int = 0) -> None:
        """Write a mapped object. The next `ecat_master_send` sends it.

        Args:
            index: Index of the object.
            value: The new value.
            subindex: Subindex of the object.

        Raises:
            MappingError: The object is not mapped.
        """
        self._cell(index, subindex).write(value)

    def has(self, index: int, subindex: int = 0) -> bool:
        """Return True if an object is mapped."""
        return (index, subindex) in self._cells

    def _cell(self, index: int, subindex: int) -> Cell:
        if not self._cells:
            raise RuntimeError("no process data before ecat_activate_master()")
        cell = self._cells.get((index, subindex))
        if cell is None:
            names = ", ".join(f"0x{i:04X}:{s:02X}" for i, s in self._cells)
            raise MappingError(
                f"slave {self.position}: 0x{index:04X}:{subindex:02X} is not exchanged",
                hint=f"exchanged objects: {names}",
            )
        return cell


class SlaveServo(SlaveBase):
    """CiA 402 axis in the drive's own units.

    Args:
        position: Position of the slave, from 0.
        vendor: Required vendor; None accepts any.
        product: Required product; None accepts any.
        mode: "csp", "csv" or "cst".
    """

    def __init__(
        self,
        position: int,
        vendor: int | None = None,
        product: int | None = None,
        mode: str = "csp",
    ) -> None:
        super().__init__(position, vendor, product, SERVO_OBJECTS)
        if mode.upper() not in Mode.__members__:
            raise ValueError(f'invalid mode {mode!r}: use "csp", "csv" or "cst"')
        self._mode = Mode[mode.upper()]
        target = TARGETS[self._mode]
        self.objects = tuple(
            replace(each, required=True) if each.index == target else each for each in self.objects
        )
        self.start_up = ((Object.MODE_OF_OPERATION, 0, bytes([self._mode])),)

    def enable(self) -> bool:
        """Take one step towards operation enabled. Call it in every cycle.

        Until the axis is enabled, the target position follows the actual position. A fault is reset
        without an error; call `check` to detect it.

        Returns:
            True if the axis is in operation enabled.
        """
        state = self.state
        if self.has(Object.MODE_OF_OPERATION):
            self.write(Object.MODE_OF_OPERATION, self._mode)
        self.write(Object.CONTROLWORD, COMMANDS.get(state, 0) if state is not None else 0)
        if state is AxisState.OPERATION_ENABLED:
            return True
        if self.has(Object.TARGET_POSITION):
            self.write(Object.TARGET_POSITION, self.read_position())
        return False

    def disable(self) -> None:
        """Write controlword 0 (disable voltage)."""
        self.write(Object.CONTROLWORD, 0)

    @property
    def state(self) -> AxisState | None:
        """CiA 402 state of the axis; None if its statusword encodes no valid state."""
        return state_of(self.read(Object.STATUSWORD))

    def check(self) -> None:
        """Check that the axis is not in fault.

        Raises:
            DriveError: The axis is in fault, or in its fault reaction.
        """
        if self.state in (AxisState.FAULT, AxisState.FAULT_REACTION_ACTIVE):
            raise DriveError(f"slave {self.position} is in fault", hint="read its object 0x603F")

    def set_position(self, counts: int) -> None:
        self.write(Object.TARGET_POSITION, counts)

    def read_position(self) -> int:
        return self.read(Object.POSITION_ACTUAL)

    def set_velocity(self, counts: int) -> None:
        self.write(Object.TARGET_VELOCITY, counts)

    def read_velocity(self) -> int:
        return self.read(Object.VELOCITY_ACTUAL)

    def set_torque(self, permille: int) -> None:
        """Set the target torque in thousandths of the rated torque."""
        self.write(Object.TARGET_TORQUE, permille)

    def read_torque(self) -> int:
        """Return the actual torque in thousandths of the rated torque."""
        return self.read(Object.TORQUE_ACTUAL)

    def set_mode(self, mode: int) -> None:
        """Set the mode of operation (0x6060): 8 CSP, 9 CSV, 10 CST. `enable` keeps writing it."""
        self._mode = Mode(mode)
        self.write(Object.MODE_OF_OPERATION, mode)

    def read_mode(self) -> int:
        return self.read(Object.MODE_OF_OPERATION_DISPLAY)


TARGETS = {
    Mode.CSP: Object.TARGET_POSITION,
    Mode.CSV: Object.TARGET_VELOCITY,
    Mode.CST: Object.TARGET_TORQUE,
}
_OUT, _IN = Direction.OUTPUT, Direction.INPUT
SERVO_OBJECTS = (
    RawObject(Object.CONTROLWORD, 0, 16, _OUT),
    RawObject(Object.MODE_OF_OPERATION, 0, 8, _OUT, signed=True, required=False),
    RawObject(Object.TARGET_POSITION, 0, 32, _OUT, signed=True, required=False),
    RawObject(Object.TARGET_VELOCITY, 0, 32, _OUT, signed=True, required=False),
    RawObject(Object.TARGET_TORQUE, 0, 16, _OUT, signed=True, required=False),
    RawObject(Object.STATUSWORD, 0, 16, _IN),
    RawObject(Object.MODE_OF_OPERATION_DISPLAY, 0, 8, _IN, signed=True, required=False),
    RawObject(Object.POSITION_ACTUAL, 0, 32, _IN, signed=True),
    RawObject(Object.VELOCITY_ACTUAL, 0, 32, _IN, signed=True, required=False),
    RawObject(Object.TORQUE_ACTUAL, 0, 16, _IN, signed=True, required=False),
)


class SlaveIO(SlaveBase):
    """Channels of a terminal, in the order of its process data.

    Entries of one bit are digital channels, wider entries are analogue channels.

    Args:
        position: Position of the slave, from 0.
        vendor: Required vendor; None accepts any.
        product: Required product; None accepts any.
        signed: True if analogue channels are in two's complement.
    """

    def __init__(
        self,
        position: int,
        vendor: int | None = None,
        product: int | None = None,
        signed: bool = True,
    ) -> None:
        super().__init__(position, vendor, product)
        self._signed = signed

    def adopt(self, description: DeviceDescription) -> None:
        super().adopt(description)
        # Index and subindex identify an object. An object that is mapped twice is one channel.
        objects: dict[tuple[Direction, int, int], RawObject] = {}
        for direction in Direction:
            for entry in mapped_entries(description.assignments(direction)):
                place = (entry.index, entry.subindex)
                if entry.bit_length <= 64:
                    signed = self._signed and entry.bit_length > 1
                    found = RawObject(*place, entry.bit_length, direction, signed=signed)
                    objects.setdefault((direction, *place), found)
        self.objects = tuple(objects.values())

    def read_digital(self, channel: int) -> int:
        return self.read(*self._channel(_IN, True, channel))

    def write_digital(self, channel: int, value: int) -> None:
        index, subindex = self._channel(_OUT, True, channel)
        self.write(index, int(bool(value)), subindex)

    def read_analog(self, channel: int) -> int:
        return self.read(*self._channel(_IN, False, channel))

    def write_analog(self, channel: int, value: int) -> None:
        index, subindex = self._channel(_OUT, False, channel)
        self.write(index, value, subindex)

    def _channel(self, direction: Direction, digital: bool, channel: int) -> tuple[int, int]:
        mine = [
            each.place
            for each in self.objects
            if each.direction is direction and (each.bit_length == 1) is digital
        ]
        if not 0 <= channel < len(mine):
            kind = "digital" if digital else "analogue"
            raise ValueError(
                f"{kind} channel {channel} does not exist: slave {self.position} has {len(mine)} "
                "such channels"
            )
        return mine[channel]


def pdos_of(slaves: Sequence[SlaveBase]) -> dict[int, DeviceRequest]:
    """Return the process-data requests of all slaves, by position."""
    return {
        slave.position: DeviceRequest(
            outputs=_references(slave, Direction.OUTPUT),
            inputs=_references(slave, Direction.INPUT),
            start_up=slave.start_up,
        )
        for slave in slaves
    }


def columns_of(slaves: Sequence[SlaveBase], layout: ImageLayout) -> RequestTables:
    """Return one integer column per mapped object, in the order of slaves and objects."""
    sides: dict[Direction, list[Column]] = {Direction.OUTPUT: [], Direction.INPUT: []}
    for slave in slaves:
        for each in slave.objects:
            find = layout.output if each.direction is Direction.OUTPUT else layout.input
            which = Which(bit_length=each.bit_length)
            number = find(slave.position, each.index, each.subindex, which)
            if number is None:
                continue
            kind = NumberKind.SIGNED if each.signed else NumberKind.UNSIGNED
            name = f"{slave.position} 0x{each.index:04X}:{each.subindex:02X}"
            column = Column(
                name,
                type(number)(number.bit_offset, number.bit_length, kind),
                Bank.INTEGER,
                slave.position,
                layout.sync_unit(slave.position),
            )
            sides[each.direction].append(column)
    return RequestTables((), tuple(sides[Direction.OUTPUT]), tuple(sides[Direction.INPUT]))


def _references(slave: SlaveBase, direction: Direction) -> tuple[ObjectReference, ...]:
    return tuple(
        ObjectReference(each.index, each.subindex, each.bit_length, each.required)
        for each in slave.objects
        if each.direction is direction
    )
