"""Place: a channel in the bytes of its device, read and written in Python."""

from __future__ import annotations

from typing import NamedTuple

from catenary.drive.channel import Channel
from catenary.drive.device_channels import NamedChannel
from catenary.errors import MappingError
from catenary.model.device import Direction
from catenary.plan.wish import ImageLayout


class Place(NamedTuple):
    """Bits of a channel in the bytes of its device."""

    channel: Channel
    first: int  # byte
    end: int
    shift: int  # of its lowest bit

    def read(self, image: memoryview | bytearray) -> float | int:
        raw = int.from_bytes(image[self.first : self.end], "little") >> self.shift
        return self.channel.decode(raw & ((1 << self.channel.bit_length) - 1))

    def write(self, image: memoryview | bytearray, value: float | int) -> None:
        mask = (1 << self.channel.bit_length) - 1 << self.shift
        raw = int.from_bytes(image[self.first : self.end], "little") & ~mask
        raw |= self.channel.encode(value) << self.shift
        image[self.first : self.end] = raw.to_bytes(self.end - self.first, "little")


def make_place(each: NamedChannel, layout: ImageLayout, direction: Direction) -> Place:
    """Return the place of a channel. MappingError if it is not mapped with its length."""
    find = layout.output if direction is Direction.OUTPUT else layout.input
    channel = each.channel
    number = find(each.device, channel.index, channel.subindex, each.which)
    if number is None or number.bit_length != channel.bit_length:
        found = "is not" if number is None else f"has {number.bit_length} bits"
        raise MappingError(
            f"device {each.device}: {channel.place} ({each.name!r}, {channel.bit_length} bits) "
            f"{found} in its process data",
            hint="another request may have changed the mapping; print(sub.pdos) shows it",
        )
    bit = number.bit_offset - 8 * layout.byte_range(each.device, direction).start
    first, shift = divmod(bit, 8)
    return Place(channel, first, first + (shift + channel.bit_length + 7) // 8, shift)
