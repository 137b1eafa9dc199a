"""Inputs and Outputs, the process data of SubDevices as arrays and by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Generic, TypeVar, overload

import numpy as np
import numpy.typing as npt

from catenary.bus import SubDevice
from catenary.core import Cycle
from catenary.drive.arguments import (
    PdoList,
    clock_request,
    cycles_between,
    start_up_list,
    written_pdos,
)
from catenary.drive.channel import Channel, ChannelSpec, make_channels
from catenary.drive.device_channels import (
    NamedChannel,
    chosen_channels,
    column,
    mapped_channels,
    with_chosen,
)
from catenary.drive.modules import described
from catenary.drive.oversampling import (
    Oversampled,
    checked_samples,
    group_samples,
    time_channel,
)
from catenary.drive.request import Request
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.cycle import Bank
from catenary.plan.request import (
    Bytes,
    DeviceRequest,
    DistributedClock,
    ImageLayout,
    Integers,
    Reals,
    RequestTables,
    Views,
    WrittenPdo,
)
from catenary.plan.start_up_object import StartUp

A = TypeVar("A", Reals, Integers, Bytes)


class BankArray(Generic[A]):
    """Attribute of Inputs and Outputs that is the array of a bank.

    An assignment writes into the array of Outputs. For Inputs, it raises AttributeError.
    """

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
    """Process-data request for some devices in one direction."""

    direction: Direction

    bits: BankArray[Bytes] = BankArray(Bank.BIT)
    """Channels of one bit, 0 or 1, in the order of `names` (k,)."""
    integers: BankArray[Integers] = BankArray(Bank.INTEGER)
    """Channels with raw integers, in the order of `names` (k,)."""
    reals: BankArray[Reals] = BankArray(Bank.REAL)
    """Channels with a scale or of type REAL, in the order of `names` (k,)."""

    def __init__(
        self,
        *subs: SubDevice,
        channels: Mapping[str, ChannelSpec] | None = None,
        scale: Mapping[str, float] | None = None,
        required: bool = True,
        divider: int = 1,
        dc: DistributedClock | bool = False,
        oversampling: int | None = None,
        pdos: PdoList = (),
        start_up: Sequence[StartUp] = (),
    ) -> None:
        super().__init__(subs)
        named = make_channels("channels", channels or {})
        self._pdos = {sub.position: self._chosen_pdos(sub, pdos, named) for sub in subs}
        self._required = required
        self._divider = cycles_between("divider", divider)
        self._clock = clock_request(dc)
        self._start_up = start_up_list(start_up)
        self._units: list[int] = []
        self._arrays: dict[Bank, Reals | Integers | Bytes] | None = None
        self._unit_valid: Bytes | None = None
        self._oversampled: Oversampled | None = None
        self._exchange = 0.0  # [s] between two exchanges
        self._system_time: Callable[[], int | None] = lambda: None
        if oversampling is not None:
            self._oversampled = self._samples_of(oversampling, named, scale or {})
            self._channels = self._oversampled.channels
        else:
            self._channels = self._chosen_channels(named, scale)
        self._places: dict[str, tuple[Reals | Integers | Bytes, int]] = {}

    def _chosen_channels(
        self, named: Mapping[str, Channel], scale: Mapping[str, float] | None
    ) -> tuple[NamedChannel, ...]:
        """Return the channels of the option `channels`; without it, all mapped channels."""
        if not named:
            devices = [self._described(sub) for sub in self.subs]
            return mapped_channels(devices, self.direction, scale or {})
        if len(self.subs) != 1:
            raise ValueError(
                f"channels= needs exactly one device, not {len(self.subs)}; make one request per "
                "device"
            )
        if scale is not None:
            raise ValueError(
                "scale= cannot be combined with channels=; give the scale of each channel, "
                "(index, subindex, type, scale)"
            )
        return chosen_channels(self.subs[0], named)

    def _samples_of(
        self, samples: int, named: Mapping[str, Channel], scale: Mapping[str, float]
    ) -> Oversampled:
        """Return the channels of the option `oversampling`."""
        if named or len(self.subs) != 1:
            raise ValueError("oversampling= needs exactly one device, and no channels=")
        count = checked_samples(samples)
        return group_samples(self._chosen_channels({}, None), count, scale)

    def _chosen_pdos(
        self, sub: SubDevice, pdos: PdoList, named: Mapping[str, Channel]
    ) -> tuple[WrittenPdo, ...]:
        if not pdos:
            return ()
        written = written_pdos(pdos, named, sub.description)
        return tuple(pdo for pdo in written if pdo.direction is self.direction)

    def _described(self, sub: SubDevice) -> DeviceDescription:
        """Return the description of a device with the PDOs of this request."""
        device = described(sub, None)
        return with_chosen(device, self._pdos[sub.position], self._clock, [self.direction])

    def array(self, bank: Bank) -> Reals | Integers | Bytes:
        """Return the array of a bank. Raises RuntimeError before a loop is open."""
        if self._arrays is None:
            raise RuntimeError(f"{type(self).__name__} have no values before a Loop is open")
        return self._arrays[bank]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all channels, in the order of `channels`; without it, of the process data."""
        return tuple(channel.name for channel in self._channels)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.names)

    def __getitem__(self, name: str) -> float | int:
        """Return the value of a channel: 0 or 1, a raw integer, or a float.

        Raises:
            KeyError: The name is unknown.
            RuntimeError: No loop has been opened yet.
        """
        array, place = self._place(name)
        value: float | int = array.item(place)
        return value

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the process-data request of each device, by position.

        Without chosen channels and PDOs, the mapping of the devices does not change.
        """
        self._exchange = period_ns * 1e-9 * self._divider
        requests: dict[int, DeviceRequest] = {}
        for sub in self.subs:
            mine = tuple(c.channel.reference() for c in self._channels if c.device == sub.position)
            output = self.direction is Direction.OUTPUT
            requests[sub.position] = DeviceRequest(
                outputs=mine if output else (),
                inputs=() if output else mine,
                clock=self._clock,
                divider=self._divider,
                required=self._required,
                pdos=self._pdos[sub.position],
                objects=self._start_up,
            )
        return requests

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return one column per channel.

        Raises:
            MappingError: A channel is not in the process data.
        """
        columns = tuple(column(channel, layout, self.direction) for channel in self._channels)
        self._units = [layout.sync_unit(sub.position) for sub in self.subs]
        if self.direction is Direction.OUTPUT:
            return RequestTables(output_columns=columns)
        return RequestTables(input_columns=columns)

    @property
    def present(self) -> tuple[bool, ...]:
        """Tuple with True for each SubDevice that replied in its last exchange.

        Raises:
            RuntimeError: No loop has been opened yet.
        """
        if self._unit_valid is None:
            raise RuntimeError("no process data is exchanged before a Loop is open")
        return tuple(bool(self._unit_valid[unit]) for unit in self._units)

    @property
    def sample_names(self) -> tuple[str, ...]:
        """Names of the oversampled objects, in the order of `samples`; empty without them."""
        return self._oversampled.names if self._oversampled else ()

    @property
    def samples(self) -> Reals | Integers | Bytes:
        """Samples of one cycle, oldest first (objects, `oversampling`): a view of the array.

        Raises:
            RuntimeError: The request has no `oversampling=`, or no loop has been opened yet.
        """
        if self._oversampled is None:
            raise RuntimeError(f"{self!r} has no samples: it was made without oversampling=")
        count, each = len(self._oversampled.names), self._oversampled.samples
        bank = self._oversampled.channels[0].channel.bank
        return self.array(bank)[: count * each].reshape(count, each)

    def sample_times(self, cycle: Cycle) -> Reals:
        """Return the time of each sample on the clock of the loop, as `cycle.time` [s].

        They follow from StartTimeNextLatch (0x1D09:98, or 0x1D09:90), the time at which the next
        samples begin (Beckhoff, EL5031-0011): the first sample is one exchange older.

        Args:
            cycle: present cycle.

        Raises:
            RuntimeError: The device does not exchange this object, the request has no
                `oversampling=`, or the loop has no distributed clocks.
        """
        each = time_channel(self._channels) if self._oversampled else None
        present = self._system_time()
        if self._oversampled is None or each is None or present is None:
            raise RuntimeError(
                f"{self!r}: the times of samples need oversampling=, dc=, and the object "
                "StartTimeNextLatch (0x1D09:98) in the process data; choose its PDO with pdos="
            )
        span = 1 << each.channel.bit_length
        age = (present - int(self[each.name]) + span // 2) % span - span // 2
        count = self._oversampled.samples
        steps = np.arange(count, dtype=np.float64) / count - 1.0
        return cycle.time - age * 1e-9 + steps * self._exchange

    def _bind(self, reals: Reals, integers: Integers, bits: Bytes, views: Views) -> None:
        self._system_time, unit_valid = views.system_time, views.unit_valid
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
            raise KeyError(
                f"unknown channel {name!r}; the channels are {', '.join(self.names)}"
            ) from None


class Inputs(Channels):
    """Inputs of SubDevices as arrays: `.bits` (uint8), `.integers` (int64), `.reals` (float64).

        buttons = Inputs(subs[1])
        gauge = Inputs(subs[2], scale={"Value": 10 / 0x7FFF})
        sensor = Inputs(subs[3], channels={"force": (0x6000, 1, types.REAL)})

    Each array has the order of `names`. A channel is also accessible by name:
    `buttons["Input 1"]`.

    Args:
        *subs: devices.
        channels: objects of one device, `{name: Channel}` or `{name: (index, subindex, type[,
            scale])}`. They are mapped if necessary. None for all mapped channels, with names from
            the SII or the object dictionary.
        scale: factor of each mapped channel by name. Such a channel is a float.
        required: if False, the loop continues without a lost device, and its channels keep their
            last values: see `present`.
        divider: n to exchange in every n-th cycle of the loop.
        dc: distributed clocks, as for `Drives`.
        oversampling: number of samples per cycle of an oversampling terminal; see `samples`. The
            keys of `scale` are then those of `sample_names`.
        pdos: PDOs to assign instead of the present ones, as for `Drives`.
        start_up: objects to write to each device before SAFE-OP.

    Raises:
        TypeError: An option has the wrong type.
        ValueError: The devices have no channels, or an option is not valid.
    """

    direction = Direction.INPUT

    def bind(self, views: Views) -> None:
        """Connect the request to the arrays of a newly opened loop."""
        self._bind(views.input_reals, views.input_integers, views.input_bits, views)


class Outputs(Channels):
    """Outputs of SubDevices as arrays: write `.bits[:]`, `.integers[:]` and `.reals[:]`.

    All outputs are 0 at the start. A channel is also accessible by name: `lamps["Output 1"] = 1`.
    The options are those of `Inputs`. A value out of range is clamped, and `cycle.limited` is then
    True.
    """

    direction = Direction.OUTPUT

    def __setitem__(self, name: str, value: float | int) -> None:
        """Write a channel by name.

        Raises:
            KeyError: The name is unknown.
            RuntimeError: No loop has been opened yet.
        """
        array, place = self._place(name)
        array[place] = value

    def bind(self, views: Views) -> None:
        """Connect the request to the arrays of a newly opened loop."""
        self._bind(views.output_reals, views.output_integers, views.output_bits, views)
