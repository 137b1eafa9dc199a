"""Everything that a virtual device takes from a file: from an SII, an ESI or a clone."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.virtual.coe.object_facts import ObjectFacts
from catenary.virtual.crystal import ClockBits
from catenary.virtual.description import Description

RAM_START, RAM_LEAST, RAM_MAX = 0x1000, 0x2000, 61440  # [bytes]
SYNC_MANAGERS_MAX = 8  # of a virtual controller
BUFFER_MAX = 2048  # largest buffer with process data [bytes]
EMULATION = 0x0100  # bit of the first word of the SII


@dataclass(frozen=True, slots=True)
class Blueprint:
    """Facts of one device. The numbers of slots and axes in `description` are not used."""

    description: Description
    image: bytes  # content of the EEPROM
    ports: tuple[int, ...] = (0, 1)
    objects: tuple[ObjectFacts, ...] = ()
    exact: bool = False  # True if `objects` are all objects of a real device, with its rights
    serves_coe: bool = True  # False: its mailbox refuses CoE
    information: bytes = b""  # registers 0x0000 to 0x0009; empty: those of the virtual controller
    clock_bits: ClockBits | None = None  # width of the clock; None: that of the options
    alias: int | None = None  # register 0x0012, if a switch sets it; None: that of the image


def ram_for(buffers: list[tuple[int, int]], least: int = RAM_LEAST) -> int:
    """Return the size of the memory from 0x1000 on, so that all buffers fit three times [bytes].

    Args:
        buffers: Start address and size [bytes] of each buffer.
        least: Smallest result [bytes].
    """
    ends = [start - RAM_START + 3 * size for start, size in buffers]
    return min(max([least, *ends]), RAM_MAX)
