"""Inputs and Outputs: any SubDevice's process data as named columns, single bits included."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, NoReturn

import numpy.typing as npt

from catenary.bus import SubDevice
from catenary.drive.arguments import PdoList, clock_wish, cycles_between, written_pdos
from catenary.drive.attributes import check_writable, unknown_attribute
from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, Pdo
from catenary.plan.cycle import Bank, Column, NumberKind
from catenary.plan.numbers import ANY, Which
from catenary.plan.pdo_rewrite import write_down
from catenary.plan.pdo_search import pdo_names
from catenary.plan.wish import (
    Bytes,
    DistributedClock,
    ImageLayout,
    Integers,
    ObjectReference,
    PdoWish,
    Reals,
    Views,
    WishTables,
    WrittenPdo,
)

# Data types of ETG.1000.6 table 64 that are not unsigned integers.
SIGNED_TYPES = frozenset((0x02, 0x03, 0x04, 0x10, 0x12, 0x13, 0x14, 0x15))
REAL_TYPES = frozenset((0x08, 0x11))


class Channel(NamedTuple):
    """One entry of a device's process data and the name it goes by."""

    name: str
    device: int
    entry: Entry
    scale: float | None  # SI value = raw · scale; None: the raw number
    which: Which = ANY  # where the device maps the object more than once

    @property
    def kind(self) -> NumberKind:
        if self.entry.data_type in REAL_TYPES:
            return NumberKind.REAL
        return NumberKind.SIGNED if self.entry.data_type in SIGNED_TYPES else NumberKind.UNSIGNED

    @property
    def bank(self) -> Bank:
        if self.scale is not None or self.kind is NumberKind.REAL:
            return Bank.REAL
        return Bank.BIT if self.entry.bit_length == 1 else Bank.INTEGER


class _Channels:
    """The process data of some devices in one direction, as a wish."""

    direction: Direction

    def __init__(
        self,
        *subs: SubDevice,
        scale: Mapping[str, float] | None = None,
        required: bool = True,
        divider: int = 1,
        dc: DistributedClock | bool = False,
        pdos: PdoList = (),
    ) -> None:
        self._subs = subs
        self._pdos = tuple(p for p in written_pdos(pdos) if p.direction is self.direction)
        self._required = required
        self._divider = cycles_between("divider", divider)
        self._clock = clock_wish(dc)
        self._units: list[int] = []
        self._arrays: tuple[Reals, Integers, Bytes] | None = None
        self._unit_valid: Bytes | None = None
        devices = [with_written(sub.description, self.direction, self._pdos) for sub in subs]
        self._channels = channels(devices, self.direction, scale or {})
        self._places: dict[str, tuple[Reals | Integers | Bytes, int]] = {}

    def __getattr__(self, name: str) -> NoReturn:
        raise unknown_attribute(self, name)  # reached only if there is none of this name

    def __setattr__(self, name: str, value: object) -> None:
        check_writable(self, name)
        object.__setattr__(self, name, value)

    @property
    def subs(self) -> tuple[SubDevice, ...]:
        """Devices of these channels."""
        return self._subs

    @property
    def bits(self) -> Bytes:
        """(k,) channels of one bit, 0 or 1, in the order of the process data."""
        return self._bound()[2]

    @bits.setter
    def bits(self, values: npt.ArrayLike) -> None:
        self._write(self.bits, values)

    @property
    def integers(self) -> Integers:
        """(k,) raw integers, in the order of the process data."""
        return self._bound()[1]

    @integers.setter
    def integers(self, values: npt.ArrayLike) -> None:
        self._write(self.integers, values)

    @property
    def reals(self) -> Reals:
        """(k,) channels with a scale and REAL numbers, in the order of the process data."""
        return self._bound()[0]

    @reals.setter
    def reals(self, values: npt.ArrayLike) -> None:
        self._write(self.reals, values)

    def _bound(self) -> tuple[Reals, Integers, Bytes]:
        if self._arrays is None:
            raise RuntimeError(f"{type(self).__name__} have no values before a Loop is open")
        return self._arrays

    def _write(self, array: Reals | Integers | Bytes, values: npt.ArrayLike) -> None:
        if self.direction is Direction.INPUT:
            raise AttributeError("inputs are read-only")
        array[:] = values

    @property
    def names(self) -> tuple[str, ...]:
        """Of all channels, in the order of the process data."""
        return tuple(channel.name for channel in self._channels)

    def __getitem__(self, name: str) -> float | int:
        """The channel's value: 0 or 1, the raw integer, or the float where it has a scale."""
        array, place = self._place(name)
        value: float | int = array.item(place)
        return value

    def pdos(self, period_ns: int) -> Mapping[int, PdoWish]:
        """Request what is mapped already, or `pdos`: without them nothing changes on the device."""
        wishes: dict[int, PdoWish] = {}
        for sub in self.subs:
            mine = tuple(reference(c.entry) for c in self._channels if c.device == sub.position)
            output = self.direction is Direction.OUTPUT
            wishes[sub.position] = PdoWish(
                outputs=mine if output else (),
                inputs=() if output else mine,
                clock=self._clock,
                divider=self._divider,
                required=self._required,
                pdos=self._pdos,
            )
        return wishes

    def tables(self, layout: ImageLayout) -> WishTables:
        """One column per channel."""
        columns = tuple(column(channel, layout, self.direction) for channel in self._channels)
        self._units = [layout.sync_unit(sub.position) for sub in self.subs]
        if self.direction is Direction.OUTPUT:
            return WishTables(output_columns=columns)
        return WishTables(input_columns=columns)

    @property
    def present(self) -> tuple[bool, ...]:
        """Which of the SubDevices answered in their last exchange."""
        if self._unit_valid is None:
            raise RuntimeError("nothing is exchanged before a Loop is open")
        return tuple(bool(self._unit_valid[unit]) for unit in self._units)

    def _bind(self, reals: Reals, integers: Integers, bits: Bytes, unit_valid: Bytes) -> None:
        self._unit_valid = unit_valid
        self._arrays = reals, integers, bits
        arrays: dict[Bank, Reals | Integers | Bytes]
        arrays = {Bank.REAL: reals, Bank.INTEGER: integers, Bank.BIT: bits}
        used = dict.fromkeys(Bank, 0)
        for channel in self._channels:
            self._places[channel.name] = (arrays[channel.bank], used[channel.bank])
            used[channel.bank] += 1

    def _place(self, name: str) -> tuple[Reals | Integers | Bytes, int]:
        try:
            return self._places[name]
        except KeyError:
            if name in self.names:
                raise RuntimeError(f"{name!r} has no value before a Loop is open") from None
            raise KeyError(f"no channel {name!r}; there are: {', '.join(self.names)}") from None


class Inputs(_Channels):
    """The inputs of SubDevices: `.bits` (uint8), `.integers` (int64) and `.reals` (float64), each
    in the order of the process data, or one by name: `buttons["Input 1"]`.

    `scale` turns raw numbers into floats: `Inputs(sub, scale={"Value": 10 / 0x7FFF})`.
    `required=False`: the loop goes on without a device that vanishes; its channels keep their last
    values, `present` tells. `divider`: exchanged every so many cycles of the loop.
    `dc`: distributed clocks, as for `Drives`. `pdos`: these PDOs instead of those assigned now.
    """

    direction = Direction.INPUT

    def bind(self, views: Views) -> None:
        """Receives the arrays of the loop that opens."""
        self._bind(views.input_reals, views.input_integers, views.input_bits, views.unit_valid)


class Outputs(_Channels):
    """The outputs of SubDevices, all 0 at the start: write `.bits[:]`, `.integers[:]`, `.reals[:]`,
    or one by name: `lamps["Output 1"] = 1`. `scale`, `required`, `divider`, `dc`, `pdos` as for
    `Inputs`.
    What is out of its range is cut, and `cycle.limited` says so."""

    direction = Direction.OUTPUT

    def __setitem__(self, name: str, value: float | int) -> None:
        array, place = self._place(name)
        array[place] = value

    def bind(self, views: Views) -> None:
        """Receives the arrays of the loop that opens."""
        self._bind(views.output_reals, views.output_integers, views.output_bits, views.unit_valid)


def channels(
    devices: Iterable[DeviceDescription], direction: Direction, scale: Mapping[str, float]
) -> tuple[Channel, ...]:
    """All channels of the devices, each with a name of its own. ValueError: there are none."""
    devices = list(devices)
    if not devices:
        raise ValueError(
            f"no device is given whose {direction.name.lower()} process data are meant: was one "
            "found? main.subs shows all; a group is empty where no device has its alias"
        )
    found = [
        (device, pdo, entry)
        for device in devices
        for assignment in device.assignments(direction)
        for pdo, entry in number_entries(assignment)
    ]
    if not found:
        raise ValueError(
            f"no {direction.name.lower()} process data in the devices given"
            f"{_choice(devices, direction)}"
        )
    names = unique_names([(e.name, pdo.name, str(device.position)) for device, pdo, e in found])
    for name in scale:
        if name not in names:
            raise ValueError(f"scale: no channel {name!r}; there are: {', '.join(names)}")
    alike: Counter[tuple[int, int, int, int, int]] = Counter()
    made = []
    for name, (device, pdo, entry) in zip(names, found, strict=True):
        place = (device.position, pdo.index, entry.index, entry.subindex, entry.bit_length)
        which = Which(pdo.index, entry.bit_length, alike[place])
        alike[place] += 1
        made.append(Channel(name, device.position, entry, scale.get(name), which))
    return tuple(made)


def _choice(devices: Sequence[DeviceDescription], direction: Direction) -> str:
    """Return the PDOs that could be assigned, if there are any."""
    offered = [pdo for device in devices for pdo in device.pdos(direction)]
    return f": none is assigned; choose with pdos= from {pdo_names(offered)}" if offered else ""


def with_written(
    device: DeviceDescription, direction: Direction, pdos: Sequence[WrittenPdo]
) -> DeviceDescription:
    """Return the device as if it had these PDOs; unchanged without PDOs."""
    if not pdos:
        return device
    return device.with_process_data(direction, write_down(device, direction, pdos).assignments)


def number_entries(assignment: Assignment) -> list[tuple[Pdo, Entry]]:
    """Return all entries with their PDOs, without gaps and without what no number can hold."""
    return [
        (pdo, entry)
        for pdo in assignment.pdos
        for entry in pdo.entries
        if entry.index and 1 <= entry.bit_length <= 64
    ]


def unique_names(parts: list[tuple[str, str, str]]) -> list[str]:
    """A name for each (entry, PDO, position): as short as tells them apart, then numbered.

    Terminals call every channel's entry "Output" and tell them apart by their PDO, "Channel 3".
    """
    for spelling in (short_name, pdo_name, full_name):
        names = [spelling(*part) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{name} {names[: i + 1].count(name)}" for i, name in enumerate(names)]


def short_name(entry: str, pdo: str, position: str) -> str:
    return entry or pdo or "value"


def pdo_name(entry: str, pdo: str, position: str) -> str:
    return f"{pdo} {entry}".strip() or "value"


def full_name(entry: str, pdo: str, position: str) -> str:
    return f"{position} {pdo_name(entry, pdo, position)}"


def reference(entry: Entry) -> ObjectReference:
    return ObjectReference(entry.index, entry.subindex, entry.bit_length)


def column(channel: Channel, layout: ImageLayout, direction: Direction) -> Column:
    """The channel with its place."""
    entry = channel.entry
    find = layout.output if direction is Direction.OUTPUT else layout.input
    number = find(channel.device, entry.index, entry.subindex, channel.which)
    if number is None:
        raise MappingError(f"device {channel.device}: {entry} is not in its process data")
    return Column(
        name=channel.name,
        number=replace(number, kind=channel.kind, scale=channel.scale or 1.0, offset=0.0),
        bank=channel.bank,
        device=channel.device,
        sync_unit=layout.sync_unit(channel.device),
    )
