"""ProcessData, the inputs and outputs of one device of any kind, as bytes and by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches

from catenary.bus import SubDevice
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
    number_entries,
    place_entries,
    unique_names,
    with_chosen,
)
from catenary.drive.image_place import Place, make_place
from catenary.drive.modules import Modules, chosen_modules, described
from catenary.drive.request import Request
from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.cycle import ImageArea
from catenary.plan.request import (
    Bytes,
    DeviceRequest,
    DistributedClock,
    ImageLayout,
    RequestTables,
    Views,
)
from catenary.plan.start_up_object import StartUp


class ProcessData(Request):
    """Process-data request for one device of any kind.

        raw = ProcessData(sub)  # with the present mapping; nothing is written to the device
        sensor = ProcessData(sub, inputs={"force": (0x6000, 1, types.REAL)})

    While a loop is open, `inputs` and `outputs` are memoryviews of the bytes of the device, and
    `sensor["force"]` is the value of one object. `next(loop)` sends the present outputs and updates
    the inputs. All outputs are 0 at the start.

    Args:
        sub: the device.
        inputs: `{name: (index, subindex, type[, scale])}`, or a `Channel` for each name. The
            objects are mapped if necessary. None for all mapped inputs, with names from the SII or
            the object dictionary. `{}` for no names;
            `inputs` still has all bytes.
        outputs: the same for outputs. The request writes all output bytes of the device, except
            with `{}`: another request can then write them.
        pdos: PDOs to assign by number or name, `[0x1A01, "Status"]`, or with their entries by name
            or as (index, subindex, bits), `{0x1A00: ["force", "status"]}`; or the name of a
            mapping of the ESI file. None to let Catenary choose them.
        safe: values of outputs by name, or the bytes of all outputs. The loop sends them when it
            ends for any reason. Outputs without a safe value become 0. The device then leaves OP
            and determines its outputs itself.
        start_up: objects to write to the device before SAFE-OP.
        divider: n to exchange in every n-th cycle of the loop.
        required: if False, the loop continues without the device; see `present`.
        dc: distributed clocks. True uses the settings in the ESI or SII of the device.
        modules: module of each slot of a modular device, by name, type or ident; None for an empty
            slot. The device must be scanned with its ESI file. None instead of a list for the
            modules that the device reports, or else the default modules of the ESI.

    Raises:
        ConfigurationError: A slot does not accept a module.
        TypeError: An option has the wrong type, for example an object that is neither a Channel nor
            (index, subindex, type[, scale]).
        ValueError: A name is unknown or used twice, a value is out of range, or `safe` is given
            with `outputs={}`.
    """

    def __init__(
        self,
        sub: SubDevice,
        *,
        inputs: Mapping[str, ChannelSpec] | None = None,
        outputs: Mapping[str, ChannelSpec] | None = None,
        pdos: PdoList | None = None,
        safe: Mapping[str, float] | bytes = b"",
        start_up: Sequence[StartUp] = (),
        divider: int = 1,
        required: bool = True,
        dc: DistributedClock | bool = False,
        modules: Modules | None = None,
    ) -> None:
        super().__init__([sub])
        self._modules = chosen_modules(sub, modules)
        device = described(sub, self._modules)
        named = _named_channels(inputs, outputs)
        known = {**(named[Direction.INPUT] or {}), **(named[Direction.OUTPUT] or {})}
        self._pdos = written_pdos(pdos or (), known, device)
        self._writes = outputs is None or bool(outputs)
        self._is_named = inputs is not None
        self._channels = {
            direction: chosen_channels(sub, channels or {}) for direction, channels in named.items()
        }
        unnamed = [direction for direction, channels in named.items() if channels is None]
        self._clock = clock_request(dc)
        self._channels |= _mapped_channels(
            with_chosen(device, self._pdos, self._clock, unnamed), unnamed, known
        )
        self._safe = bytes(safe) if isinstance(safe, bytearray | memoryview) else safe
        self._check_safe()
        self._start_up = start_up_list(start_up)
        self._divider = cycles_between("divider", divider)
        self._required = required
        self._places: dict[str, tuple[Direction, Place]] = {}
        self._images: dict[Direction, memoryview] = {}
        self._unit = -1
        self._unit_valid: Bytes | None = None

    @property
    def inputs(self) -> memoryview:
        """Input bytes of the device, read-only; the same object while the loop is open.

        Raises:
            RuntimeError: No loop has been opened yet.
        """
        return self._image(Direction.INPUT)

    @property
    def outputs(self) -> memoryview:
        """Output bytes of the device, writable; the same object while the loop is open.

        Raises:
            RuntimeError: No loop has been opened yet, or the request has `outputs={}`.
        """
        if not self._writes:
            raise RuntimeError(f"{self!r} cannot write outputs: it was made with outputs={{}}")
        return self._image(Direction.OUTPUT)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inputs, followed by those of the outputs."""
        each = (*self._channels[Direction.INPUT], *self._channels[Direction.OUTPUT])
        return tuple(channel.name for channel in each)

    @property
    def present(self) -> bool:
        """True if the device replied in its last exchange.

        Raises:
            RuntimeError: No loop has been opened yet.
        """
        if self._unit_valid is None:
            raise RuntimeError("no process data is exchanged before a Loop is open")
        return bool(self._unit_valid[self._unit])

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.names)

    def __getitem__(self, name: str) -> float | int:
        """Return a value by name: a bool, an integer, or a float if it is REAL or has a scale.

        Raises:
            KeyError: The name is unknown.
            TypeError: The name is not a string.
            RuntimeError: No loop has been opened yet.
        """
        direction, place = self._place(name)
        return place.read(self._image(direction))

    def __setitem__(self, name: str, value: float | int) -> None:
        """Write an output by name.

        Raises:
            KeyError: The name is unknown.
            TypeError: The name is that of an input or not a string, or the object needs an integer.
            ValueError: The value is out of the range of the type, or is not finite.
            RuntimeError: No loop has been opened yet.
        """
        direction, place = self._place(name)
        if direction is Direction.INPUT:
            raise TypeError(f"{self!r}: {name!r} is an input and therefore read-only")
        try:
            place.write(self._image(direction), value)
        except (TypeError, ValueError) as error:
            raise type(error)(f"{self!r}: {name!r} = {value!r}: {error}") from None

    # plan.request.ProcessDataRequest

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the request for the chosen objects, or for those that are mapped."""
        references = {
            direction: tuple(each.channel.reference() for each in channels)
            for direction, channels in self._channels.items()
        }
        request = DeviceRequest(
            outputs=references[Direction.OUTPUT],
            inputs=references[Direction.INPUT],
            clock=self._clock,
            divider=self._divider,
            required=self._required,
            pdos=self._pdos,
            objects=self._start_up,
            modules=self._modules,
        )
        return {self._subs[0].position: request}

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return the bytes as areas, and named inputs also as columns for laws and recordings.

        Raises:
            MappingError: A channel is not in the process data, or has another length there.
            ConfigurationError: `safe` does not have the length of the outputs.
        """
        device = self._subs[0].position
        self._unit = layout.sync_unit(device)
        self._places = {
            each.name: (direction, make_place(each, layout, direction))
            for direction, channels in self._channels.items()
            for each in channels
        }
        inputs = self._channels[Direction.INPUT] if self._is_named else ()
        outputs = layout.byte_range(device, Direction.OUTPUT)
        return RequestTables(
            input_columns=tuple(column(each, layout, Direction.INPUT) for each in inputs),
            input_areas=self._areas(layout.byte_range(device, Direction.INPUT)),
            output_areas=self._areas(outputs, self._safe_bytes(len(outputs)))
            if self._writes
            else (),
        )

    def bind(self, views: Views) -> None:
        """Connect the request to the bytes of a newly opened loop."""
        self._images = {
            Direction.INPUT: views.input_bytes.data,
            Direction.OUTPUT: views.output_bytes.data,
        }
        self._unit_valid = views.unit_valid

    def _check_safe(self) -> None:
        """Raise ValueError or TypeError for safe values that cannot be sent."""
        if self._safe and not self._writes:
            raise ValueError("safe= is given, but this request writes no outputs (outputs={})")
        if isinstance(self._safe, bytes):
            return
        if not isinstance(self._safe, Mapping):
            raise TypeError(
                f"safe={self._safe!r}: give {{name: value}}, or the bytes of all outputs"
            )
        channels = {each.name: each.channel for each in self._channels[Direction.OUTPUT]}
        for name, value in self._safe.items():
            if name not in channels:
                raise ValueError(f"safe: {_unknown(name, channels)}")
            try:
                channels[name].encode(value)
            except (TypeError, ValueError) as error:
                raise type(error)(f"safe[{name!r}] = {value!r}: {error}") from None

    def _safe_bytes(self, size: int) -> bytes:
        if not isinstance(self._safe, bytes):
            image = bytearray(size)
            for name, value in self._safe.items():
                self._places[name][1].write(image, value)
            return bytes(image)
        if self._safe and len(self._safe) != size:
            raise ConfigurationError(
                f"{self!r}: safe has {len(self._safe)} bytes, but the outputs of the device have "
                f"{size}",
                hint="give one value per byte, or values by name",
            )
        return self._safe or bytes(size)

    def _areas(self, place: range, safe: bytes = b"") -> tuple[ImageArea, ...]:
        if not place:
            return ()
        device = self._subs[0]
        name = f"{device.position} {device.name}"
        return (ImageArea(name, place.start, len(place), device.position, self._unit, safe),)

    def _image(self, direction: Direction) -> memoryview:
        if direction not in self._images:
            raise RuntimeError(f"{self!r} has no values before a Loop is open")
        return self._images[direction]

    def _place(self, name: str) -> tuple[Direction, Place]:
        found = self._places.get(name)
        if found is not None:
            return found
        if name in self.names:
            raise RuntimeError(f"{name!r} has no value before a Loop is open")
        if not isinstance(name, str):
            raise TypeError(
                f"{self!r}: {name!r} is not a name; use `inputs` or `outputs` to access bytes"
            )
        raise KeyError(f"{self!r}: {_unknown(name, self.names)}")


def _named_channels(
    inputs: Mapping[str, ChannelSpec] | None, outputs: Mapping[str, ChannelSpec] | None
) -> dict[Direction, dict[str, Channel] | None]:
    """Return the chosen channels by direction; None for all that are mapped."""
    named = {
        Direction.INPUT: None if inputs is None else make_channels("inputs", inputs),
        Direction.OUTPUT: None if outputs is None else make_channels("outputs", outputs),
    }
    _check_names(inputs or {}, outputs or {})
    return named


def _mapped_channels(
    device: DeviceDescription, directions: Sequence[Direction], taken: Mapping[str, Channel]
) -> dict[Direction, tuple[NamedChannel, ...]]:
    """Return the mapped channels of these directions, with names that are not in `taken`."""
    found = []
    for direction in directions:
        for assignment in device.assignments(direction):
            found += [(direction, device, *each) for each in number_entries(assignment)]
    names = unique_names([(entry.name, pdo.name, d.noun) for d, _, pdo, entry in found])
    named = [
        (f"{each[0].noun} {name}" if name in taken else name, each)
        for name, each in zip(names, found, strict=True)
    ]
    return {
        direction: place_entries(
            [name for name, each in named if each[0] is direction],
            [each[1:] for _, each in named if each[0] is direction],
            {},
        )
        for direction in directions
    }


def _check_names(inputs: Mapping[str, object], outputs: Mapping[str, object]) -> None:
    twice = [name for name in inputs if name in outputs]
    if twice:
        raise ValueError(f"{twice[0]!r} names an input and an output; each needs its own name")


def _unknown(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    near = get_close_matches(name, known, n=1)
    guess = f"; did you mean {near[0]!r}?" if near else ""
    names = f"the names are {', '.join(known)}" if known else "there are no names"
    return f"unknown name {name!r}; {names}{guess}"
