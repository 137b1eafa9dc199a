"""Place of a channel in the bytes of its device, for access in Python."""

from __future__ import annotations

from typing import NamedTuple

from catenary.drive.channel import Channel
from catenary.drive.device_channels import NamedChannel
from catenary.errors import MappingError
from catenary.model.device import Direction
from catenary.plan.request import ImageLayout


class Place(NamedTuple):
    """Place of a channel in the bytes of its device."""

    channel: Channel
    first: int  # first byte
    end: int  # index after the last byte
    shift: int  # position of the lowest bit in the first byte

    def read(self, image: memoryview | bytearray) -> float | int:
        """Return the value of the channel in the bytes of the device."""
        raw = int.from_bytes(image[self.first : self.end], "little") >> self.shift
        return self.channel.decode(raw & ((1 << self.channel.bit_length) - 1))

    def write(self, image: memoryview | bytearray, value: float | int) -> None:
        """Write a value of the channel into the bytes of the device; other bits do not change.

        Raises:
            TypeError: The type needs an integer.
            ValueError: The value is out of the range of the type, or is not finite.
        """
        mask = (1 << self.channel.bit_length) - 1 << self.shift
        raw = int.from_bytes(image[self.first : self.end], "little") & ~mask
        raw |= self.channel.encode(value) << self.shift
        image[self.first : self.end] = raw.to_bytes(self.end - self.first, "little")


def make_place(each: NamedChannel, layout: ImageLayout, direction: Direction) -> Place:
    """Return the place of a channel.

    Args:
        each: channel of a device.
        layout: layout of the process image.
        direction: direction of the channel.

    Raises:
        MappingError: The channel is not mapped, or has another length.
    """
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
