"""Copies, which the cycle makes from the inputs of a device to the outputs of another one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from catenary.bus import SubDevice
from catenary.drive.arguments import cycles_between
from catenary.drive.copy_place import CopyPlace, FoundPlace, find_place
from catenary.drive.fsoe import FsoeConnection, FsoeFrames, fsoe_problems
from catenary.drive.request import Request
from catenary.errors import ConfigurationError
from catenary.model.device import Direction
from catenary.plan.cycle import ImageArea, ImageCopy
from catenary.plan.request import (
    Bytes,
    DeviceRequest,
    ImageLayout,
    ObjectReference,
    RequestTables,
    Views,
)
from catenary.wire.fsoe import is_frame_size

BITS_MAX = 64  # of a copy that does not consist of whole bytes


@dataclass(frozen=True, slots=True)
class Copy:
    """One copy, from the inputs of a device to the outputs of another device.

        Copy(subs[1], "Inputs", subs[2], "Outputs")
        Copy(subs[1], range(0, 2), subs[3], range(4, 6))

    A place is the name or the index of a PDO, the name of an object, (index, subindex), or a range
    of the device's bytes. The texts "0x1A00", "0x6000:01" and "bytes 0 to 5" are places, too.

    Args:
        source: Device whose inputs are copied.
        source_place: Place in its inputs.
        destination: Device that receives them.
        destination_place: Place in its outputs.
    """

    source: SubDevice
    source_place: CopyPlace
    destination: SubDevice
    destination_place: CopyPlace


class _Pair(NamedTuple):
    """Places of a copy, before their bits are known."""

    source: FoundPlace
    destination: FoundPlace
    is_fsoe: bool = False

    @property
    def name(self) -> str:
        return f"{self.source} → {self.destination}"


class Copies(Request):
    """Process-data request for copies between devices (docs/how_to/copies.md).

        relay = Copies(Copy(subs[1], "Inputs", subs[2], "Outputs"))

    The cycle makes all copies, in every execution mode and while a law runs: inputs of a cycle are
    sent as outputs in the next cycle. Inputs that do not arrive keep their last valid value. Before
    the first valid value, and when the loop ends, zeros are sent. The program cannot write these
    outputs. Copying changes no mapping, except for objects that are not mapped yet.

    Args:
        *copies: `Copy` and `FsoeConnection` objects.
        optional: Devices whose loss does not end the loop.
        divider: n to exchange the devices in every n-th cycle. None: as often as other requests
            exchange each device; without them, in every cycle.

    Raises:
        TypeError: A copy or a place has the wrong type.
        ValueError: There is no copy, or an option is not valid.
        MappingError: A device does not have a place.
        ConfigurationError: A copy has one device as source and destination.
    """

    def __init__(
        self,
        *copies: Copy | FsoeConnection,
        optional: Sequence[SubDevice] = (),
        divider: int | None = None,
    ) -> None:
        self._connections = tuple(each for each in copies if isinstance(each, FsoeConnection))
        plain = [_checked(each) for each in copies if not isinstance(each, FsoeConnection)]
        if not copies:
            raise ValueError("Copies needs at least one Copy or FsoeConnection")
        ways = [Copy(*way) for each in self._connections for way in each.ways]
        super().__init__(_devices([*ways, *plain]))
        # The areas of the frames are first and in order: see `fsoe_frames`.
        self._pairs = [_pair(way, is_fsoe=True) for way in ways] + [_pair(each) for each in plain]
        for sub in optional:
            if sub not in self._subs:
                raise ValueError(f"optional: no copy uses {sub.station}")
        self._optional = {sub.position for sub in optional}
        self._divider = 0 if divider is None else cycles_between("divider", divider)
        self._areas: tuple[ImageArea, ...] = ()
        self._frames: list[Bytes] = []

    @property
    def fsoe_frames(self) -> tuple[FsoeFrames, ...]:
        """Safety frames that each FSoE connection received last, for diagnosis only.

        Raises:
            RuntimeError: No loop has been opened yet.
        """
        if self._connections and not self._frames:
            raise RuntimeError("there are no frames before a Loop is open")
        contents = [bytes(each) for each in self._frames]
        return tuple(
            FsoeFrames(str(each), contents[2 * k], contents[2 * k + 1])
            for k, each in enumerate(self._connections)
        )

    @property
    def fsoe_problems(self) -> tuple[str, ...]:
        """Contradictions between the present connection IDs as text, for diagnosis only.

        The devices detect every fault themselves. The relay never changes or stops a frame.
        """
        return fsoe_problems(self.fsoe_frames)

    # plan.request.ProcessDataRequest

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        """Return the objects of the copies by device. Mapped objects do not change."""
        return {
            sub.position: DeviceRequest(
                outputs=self._references(sub, Direction.OUTPUT),
                inputs=self._references(sub, Direction.INPUT),
                divider=self._divider,
                required=sub.position not in self._optional,
            )
            for sub in self._subs
        }

    def tables(self, layout: ImageLayout) -> RequestTables:
        """Return the copies with their bits, and areas for the frames of FSoE.

        Raises:
            MappingError: A place is not in the process data.
            ConfigurationError: A copy is not possible. The error names its places.
        """
        copies = tuple(_image_copy(pair, layout) for pair in self._pairs)
        _check_overlap(self._pairs, copies)
        self._areas = tuple(
            _area(pair, copy, layout)
            for pair, copy in zip(self._pairs, copies, strict=True)
            if pair.is_fsoe
        )
        return RequestTables(copies=copies, input_areas=self._areas)

    def bind(self, views: Views) -> None:
        """Connect the diagnosis of FSoE to the bytes of a newly opened loop."""
        self._frames = []
        start = 0
        for area in self._areas:
            self._frames.append(views.input_bytes[start : start + area.size])
            start += area.size

    def _references(self, sub: SubDevice, direction: Direction) -> tuple[ObjectReference, ...]:
        places = [pair.source if direction is Direction.INPUT else pair.destination
                  for pair in self._pairs]  # fmt: skip
        found = [p.reference() for p in places if p.device.position == sub.position]
        return tuple(dict.fromkeys(each for each in found if each is not None))


def _checked(copy: object) -> Copy:
    if not isinstance(copy, Copy):
        raise TypeError(f"Copies takes Copy and FsoeConnection objects, not {copy!r}")
    return copy


def _devices(copies: Sequence[Copy]) -> list[SubDevice]:
    """Return the devices of the copies, each once.

    Raises:
        ValueError: Two devices of a copy belong to different networks.
    """
    found: list[SubDevice] = []
    for copy in copies:
        for sub in (copy.source, copy.destination):
            if not hasattr(sub, "position"):
                raise TypeError(f"a copy needs SubDevices, such as subs[1]; not {sub!r}")
            if sub not in found:
                found.append(sub)
        if copy.source.main is not copy.destination.main:
            raise ValueError(
                f"cannot copy from {copy.source.station} to {copy.destination.station}: they "
                "belong to different networks, and each network has its own cycle thread. Connect "
                "both devices to one network, or copy the values in the program"
            )
    return found


def _pair(copy: Copy, *, is_fsoe: bool = False) -> _Pair:
    source = find_place(copy.source, Direction.INPUT, copy.source_place)
    destination = find_place(copy.destination, Direction.OUTPUT, copy.destination_place)
    if copy.source is copy.destination:
        raise ConfigurationError(
            f"{source} cannot be copied to {destination}: this is the same device",
            hint="a device connects its own inputs and outputs itself; check both names",
        )
    return _Pair(source, destination, is_fsoe)


def _image_copy(pair: _Pair, layout: ImageLayout) -> ImageCopy:
    """Return the copy with its bits. Raise ConfigurationError if it is not possible."""
    source, destination = pair.source.bits(layout), pair.destination.bits(layout)
    if len(source) != len(destination):
        raise ConfigurationError(
            f"{pair.source} has {len(source)} bits, but {pair.destination} has {len(destination)}",
            hint="both places of a copy must have the same length",
        )
    aligned = not (source.start % 8 or destination.start % 8 or len(source) % 8)
    if not aligned and len(source) > BITS_MAX:
        raise ConfigurationError(
            f"{pair.source} cannot be copied to {pair.destination}: {len(source)} bits that do "
            f"not begin and end at bytes; such a copy has at most {BITS_MAX} bits",
            hint="copy the objects one by one",
        )
    if pair.is_fsoe and not (aligned and is_frame_size(len(source) // 8)):
        raise ConfigurationError(
            f"{pair.source} ({len(source)} bits, → {pair.destination}) is not an FSoE frame: it "
            "must be whole bytes, 6 or 3 + 4·n of them",
            hint="give the PDO that has only the command, the safety data, the CRCs and the "
            "connection ID, or its range of bytes",
        )
    device = pair.destination.device.position
    return ImageCopy(
        pair.name,
        source.start,
        destination.start,
        len(source),
        device,
        layout.sync_unit(device),
    )


def _check_overlap(pairs: Sequence[_Pair], copies: Sequence[ImageCopy]) -> None:
    """Raise ConfigurationError if two copies write the same output bit."""
    order = sorted(zip(copies, pairs, strict=True), key=lambda each: each[0].output_bit)
    for (copy, pair), (other, next_pair) in pairwise(order):
        if copy.output_bit + copy.bit_length > other.output_bit:
            raise ConfigurationError(
                f"two copies write the same outputs: {pair.name}, and {next_pair.name}",
                hint="let one of them write these outputs",
            )


def _area(pair: _Pair, copy: ImageCopy, layout: ImageLayout) -> ImageArea:
    device = pair.source.device.position
    return ImageArea(
        str(pair.source),
        copy.input_bit // 8,
        copy.bit_length // 8,
        device,
        layout.sync_unit(device),
        field="fsoe_frame",
    )
