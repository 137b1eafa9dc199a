"""EtherCAT datagrams, ETG.1000.4 §5.4: header, data, working counter."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from catenary.errors import DecodeError


class EcatCommand(IntEnum):
    """Command of a datagram, ETG.1000.4 §5.4.1."""

    NOP = 0
    APRD = 1  # auto-increment address: read, write, read and write
    APWR = 2
    APRW = 3
    FPRD = 4  # configured station address
    FPWR = 5
    FPRW = 6
    BRD = 7  # broadcast
    BWR = 8
    BRW = 9
    LRD = 10  # logical address, through the FMMUs
    LWR = 11
    LRW = 12
    ARMW = 13  # the addressed device inserts data, all others store data
    FRMW = 14

    @property
    def reads(self) -> bool:
        """True if an addressed device inserts data into the datagram."""
        return self in _READS

    @property
    def writes(self) -> bool:
        """True if an addressed device stores data from the datagram."""
        return self in _WRITES

    @property
    def is_logical(self) -> bool:
        """True if the address is logical."""
        return self in _LOGICAL


_READS = frozenset(
    (
        *(
            EcatCommand.APRD,
            EcatCommand.APRW,
            EcatCommand.FPRD,
            EcatCommand.FPRW,
            EcatCommand.BRD,
            EcatCommand.BRW,
        ),
        *(EcatCommand.LRD, EcatCommand.LRW, EcatCommand.ARMW, EcatCommand.FRMW),
    )
)
_LOGICAL = frozenset((EcatCommand.LRD, EcatCommand.LWR, EcatCommand.LRW))
_WRITES = frozenset(
    (
        *(
            EcatCommand.APWR,
            EcatCommand.APRW,
            EcatCommand.FPWR,
            EcatCommand.FPRW,
            EcatCommand.BWR,
            EcatCommand.BRW,
        ),
        *(EcatCommand.LWR, EcatCommand.LRW, EcatCommand.ARMW, EcatCommand.FRMW),
    )
)

HEADER_SIZE = 10
WORKING_COUNTER_SIZE = 2
OVERHEAD = HEADER_SIZE + WORKING_COUNTER_SIZE
MAXIMUM_DATA_SIZE = 0x07FF  # limit of the 11-bit field; an Ethernet frame holds 1486 bytes

_COMMANDS = tuple(EcatCommand)  # by number
_HEADER = struct.Struct("<BBIHH")
_LENGTH_MASK = 0x07FF
_RESERVED_MASK = 0x3800
_CIRCULATING = 0x4000
_MORE_FOLLOWS = 0x8000


@dataclass(frozen=True, slots=True)
class Datagram:
    """One datagram.

    `address` has 32 bits, as on the wire: ADP | ADO << 16, or the logical address. `circulating` is
    True if the datagram passed a controller twice, which indicates a broken ring. `interrupt` is
    the OR of the ECAT event requests of all devices.
    """

    command: EcatCommand
    address: int
    data: bytes
    index: int = 0
    working_counter: int = 0
    circulating: bool = False
    interrupt: int = 0

    @property
    def adp(self) -> int:
        """Position (two's complement, incremented by each device) or station address."""
        return self.address & 0xFFFF

    @property
    def ado(self) -> int:
        """Address in the device's memory."""
        return self.address >> 16

    @property
    def size(self) -> int:
        """Length on the wire in bytes."""
        return OVERHEAD + len(self.data)

    def encode(self, *, more_follows: bool = False) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if len(self.data) > MAXIMUM_DATA_SIZE:
            raise ValueError(
                f"datagram data: {len(self.data)} bytes, at most {MAXIMUM_DATA_SIZE} fit"
            )
        length = len(self.data)
        length |= _CIRCULATING if self.circulating else 0
        length |= _MORE_FOLLOWS if more_follows else 0
        try:
            header = _HEADER.pack(self.command, self.index, self.address, length, self.interrupt)
            return header + self.data + struct.pack("<H", self.working_counter)
        except struct.error as error:
            raise ValueError(f"{self.command.name} datagram: {error}") from None


def decode_datagram(data: bytes, offset: int = 0) -> tuple[Datagram, bool]:
    """Decode the datagram at `offset`. Also return True if another datagram follows.

    Args:
        data: The bytes of a frame.
        offset: Position of the first byte of the datagram.

    Raises:
        DecodeError: The datagram is invalid or incomplete.
    """
    if not 0 <= offset <= len(data) - OVERHEAD:
        raise DecodeError(
            f"datagram at byte {offset}: needs {OVERHEAD} bytes, {max(len(data) - offset, 0)} left"
        )
    command, index, address, length, interrupt = _HEADER.unpack_from(data, offset)
    if command >= len(_COMMANDS):
        raise DecodeError(f"datagram at byte {offset}: unknown command {command}")
    if length & _RESERVED_MASK:
        raise DecodeError(f"datagram at byte {offset}: reserved bits set in 0x{length:04X}")
    start = offset + HEADER_SIZE
    end = start + (length & _LENGTH_MASK)
    if end + WORKING_COUNTER_SIZE > len(data):
        raise DecodeError(
            f"datagram at byte {offset}: specifies {end - start} bytes of data, "
            f"{max(len(data) - start - WORKING_COUNTER_SIZE, 0)} received"
        )
    datagram = Datagram(
        _COMMANDS[command],
        address,
        bytes(data[start:end]),
        index,
        int.from_bytes(data[end : end + WORKING_COUNTER_SIZE], "little"),
        bool(length & _CIRCULATING),
        interrupt,
    )
    return datagram, bool(length & _MORE_FOLLOWS)
