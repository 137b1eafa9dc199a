"""Inputs and Outputs: any SubDevice's process data as named columns, single bits included."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Generic, NamedTuple, TypeVar, overload

import numpy.typing as npt

from catenary.bus import SubDevice
from catenary.drive.arguments import PdoList, clock_wish, cycles_between, written_pdos
from catenary.drive.channel import Channel, ChannelSpec, channel_of, make_channels
from catenary.drive.request import Request
from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, Pdo
from catenary.plan.cycle import Bank, Column
from catenary.plan.numbers import ANY, Which
from catenary.plan.pdo_rewrite import write_down
from catenary.plan.pdo_search import pdo_names
from catenary.plan.start_up_object import StartUp
from catenary.plan.wish import (
    Bytes,
    DistributedClock,
    ImageLayout,
    Integers,
    PdoWish,
    Reals,
    Views,
    WishTables,
    WrittenPdo,
)

A = TypeVar("A", Reals, Integers, Bytes)


class NamedChannel(NamedTuple):
    """A channel of one device and the name it goes by."""

    name: str
    device: int
    channel: Channel
    which: Which = ANY  # where the device maps the object more than once


class BankArray(Generic[A]):
    """The array of a bank, as an attribute of Inputs and Outputs. Assigning writes its elements."""

    def __init__(self, bank: Bank) -> None:
        self._bank = bank

    @overload
    def __get__(self, owner: None, kind: type[Channels]) -> BankArray[A]: ...
    @overload
    def __get__(self, owner: Channels, kind: type[Channels]) -> A: ...
    def __get__(self, owner: Channels | None, kind: type[Channels]) -> BankArray[A] | A:
        if owner is None:
            return self
        array: A = owner.array(self._bank)  # type: ignore[assignment]
        return array

    def __set__(self, owner: Channels, values: npt.ArrayLike) -> None:
        if owner.direction is Direction.INPUT:
            raise AttributeError("inputs are read-only")
        owner.array(self._bank)[:] = values


class Channels(Request):
    """The process data of some devices in one direction, as a request."""

    direction: Direction

    bits: BankArray[Bytes] = BankArray(Bank.BIT)
    """(k,) channels of one bit, 0 or 1, in the order of the process data."""
    integers: BankArray[Integers] = BankArray(Bank.INTEGER)
    """(k,) raw integers, in the order of the process data."""
    reals: BankArray[Reals] = BankArray(Bank.REAL)
    """(k,) channels with a scale and REAL numbers, in the order of the process data."""

    def __init__(
        self,
        *subs: SubDevice,
        channels: Mapping[str, ChannelSpec] | None = None,
        scale: Mapping[str, float] | None = None,
        required: bool = True,
        divider: int = 1,
        dc: DistributedClock | bool = False,
        pdos: PdoList = (),
        start_up: Sequence[StartUp] = (),
    ) -> None:
        super().__init__(subs)
        named = make_channels("channels", channels or {})
        written = written_pdos(pdos, named)
        self._pdos = tuple(pdo for pdo in written if pdo.direction is self.direction)
        self._required = required
        self._divider = cycles_between("divider", divider)
        self._clock = clock_wish(dc)
        self._start_up = tuple(start_up)
        self._units: list[int] = []
        self._arrays: dict[Bank, Reals | Integers | Bytes] | None = None
        self._unit_valid: Bytes | None = None
        if named:
            self._channels = chosen_channels(subs, named, scale)
        else:
            devices = [with_written(sub.description, self.direction, self._pdos) for sub in subs]
            self._channels = mapped_channels(devices, self.direction, scale or {})
        self._places: dict[str, tuple[Reals | Integers | Bytes, int]] = {}

    def array(self, bank: Bank) -> Reals | Integers | Bytes:
        """Return the array of a bank. RuntimeError before a loop is open."""
        if self._arrays is None:
            raise RuntimeError(f"{type(self).__name__} have no values before a Loop is open")
        return self._arrays[bank]

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
        """Request the channels, or `pdos`: without either nothing changes on the device."""
        wishes: dict[int, PdoWish] = {}
        for sub in self.subs:
            mine = tuple(c.channel.reference() for c in self._channels if c.device == sub.position)
            output = self.direction is Direction.OUTPUT
            wishes[sub.position] = PdoWish(
                outputs=mine if output else (),
                inputs=() if output else mine,
                clock=self._clock,
                divider=self._divider,
                required=self._required,
                pdos=self._pdos,
                objects=self._start_up,
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
        arrays: dict[Bank, Reals | Integers | Bytes]
        arrays = {Bank.REAL: reals, Bank.INTEGER: integers, Bank.BIT: bits}
        self._arrays = arrays
        used = dict.fromkeys(Bank, 0)
        for each in self._channels:
            bank = each.channel.bank
            self._places[each.name] = (arrays[bank], used[bank])
            used[bank] += 1

    def _place(self, name: str) -> tuple[Reals | Integers | Bytes, int]:
        try:
            return self._places[name]
        except KeyError:
            if name in self.names:
                raise RuntimeError(f"{name!r} has no value before a Loop is open") from None
            raise KeyError(f"no channel {name!r}; there are: {', '.join(self.names)}") from None


class Inputs(Channels):
    """The inputs of SubDevices: `.bits` (uint8), `.integers` (int64) and `.reals` (float64), each
    in the order of the process data, or one by name: `buttons["Input 1"]`.

    Without `channels`, those that are mapped, by the names of the SII or the dictionary. With it,
    chosen objects of one device: `Inputs(sub, channels={"force": (0x6000, 1, types.REAL)})`, each
    a `Channel` or (index, subindex, type[, scale]); they are mapped if they are not yet.
    `scale` turns raw numbers into floats: `Inputs(sub, scale={"Value": 10 / 0x7FFF})`.
    `required=False`: the loop goes on without a device that vanishes; its channels keep their last
    values, `present` tells. `divider`: exchanged every so many cycles of the loop.
    `dc`: distributed clocks, as for `Drives`. `pdos`: these PDOs instead of those assigned now.
    `start_up`: objects that are written to each device before SAFE-OP.
    """

    direction = Direction.INPUT

    def bind(self, views: Views) -> None:
        """Receives the arrays of the loop that opens."""
        self._bind(views.input_reals, views.input_integers, views.input_bits, views.unit_valid)


class Outputs(Channels):
    """The outputs of SubDevices, all 0 at the start: write `.bits[:]`, `.integers[:]`, `.reals[:]`,
    or one by name: `lamps["Output 1"] = 1`. The options are those of `Inputs`.
    What is out of its range is cut, and `cycle.limited` says so."""

    direction = Direction.OUTPUT

    def __setitem__(self, name: str, value: float | int) -> None:
        array, place = self._place(name)
        array[place] = value

    def bind(self, views: Views) -> None:
        """Receives the arrays of the loop that opens."""
        self._bind(views.output_reals, views.output_integers, views.output_bits, views.unit_valid)


def chosen_channels(
    subs: Sequence[SubDevice], named: Mapping[str, Channel], scale: Mapping[str, float] | None
) -> tuple[NamedChannel, ...]:
    """Return the channels that the application chose. ValueError unless there is one device."""
    if len(subs) != 1:
        raise ValueError(f"channels= needs one device, not {len(subs)}: make one request for each")
    if scale is not None:
        raise ValueError("scale= belongs to mapped channels: give channels= (..., type, scale)")
    return tuple(
        NamedChannel(name, subs[0].position, channel, Which(bit_length=channel.bit_length))
        for name, channel in named.items()
    )


def mapped_channels(
    devices: Iterable[DeviceDescription], direction: Direction, scale: Mapping[str, float]
) -> tuple[NamedChannel, ...]:
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
    return place_entries(names, found, scale)


def place_entries(
    names: Sequence[str],
    found: Sequence[tuple[DeviceDescription, Pdo, Entry]],
    scale: Mapping[str, float],
) -> tuple[NamedChannel, ...]:
    """Return mapped entries as channels. One that is mapped twice keeps its own place."""
    alike: Counter[tuple[int, int, int, int, int]] = Counter()
    made = []
    for name, (device, pdo, entry) in zip(names, found, strict=True):
        place = (device.position, pdo.index, entry.index, entry.subindex, entry.bit_length)
        which = Which(pdo.index, entry.bit_length, alike[place])
        alike[place] += 1
        channel = channel_of(entry, scale.get(name))
        made.append(NamedChannel(name, device.position, channel, which))
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


def column(named: NamedChannel, layout: ImageLayout, direction: Direction) -> Column:
    """Return the channel with its place."""
    channel = named.channel
    find = layout.output if direction is Direction.OUTPUT else layout.input
    number = find(named.device, channel.index, channel.subindex, named.which)
    if number is None:
        raise MappingError(f"device {named.device}: {channel.place} is not in its process data")
    return Column(
        name=named.name,
        number=replace(number, kind=channel.kind, scale=channel.scale or 1.0, offset=0.0),
        bank=channel.bank,
        device=named.device,
        sync_unit=layout.sync_unit(named.device),
    )
