"""SyncManager blocks, registers 0x0800 + 8·k, ETG.1000.4 §6.7 and Beckhoff's ESC data sheet."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

SIZE = 8
WATCHDOG_TRIGGER = 0x40  # bit of the control byte: a write triggers the process-data watchdog
_BLOCK = struct.Struct("<HHBBBB")


class Buffering(IntEnum):
    """Buffering mode of a SyncManager."""

    THREE_BUFFERS = 0  # for process data: the newest data can always be accessed
    MAILBOX = 2  # for mailboxes: one buffer with a handshake


class Direction(IntEnum):
    """Direction of transfer, seen from the MainDevice."""

    READ = 0  # the device writes, EtherCAT reads
    WRITE = 1


class Status(IntFlag):
    """Bits of the status byte (offset 5).

    Bits 4 and 5 are the number of the last written buffer, from 0; 3 if none was written.
    """

    INTERRUPT_WRITE = 0x01
    INTERRUPT_READ = 0x02
    MAILBOX_FULL = 0x08
    BUFFER_1 = 0x10
    BUFFER_2 = 0x20
    READ_BUFFER_OPEN = 0x40
    WRITE_BUFFER_OPEN = 0x80


class Activation(IntFlag):
    """Bits of the activation byte (offset 6)."""

    ENABLE = 0x01
    REPEAT_REQUEST = 0x02
    LATCH_EVENT_ECAT = 0x40
    LATCH_EVENT_PDI = 0x80


class PdiControl(IntFlag):
    """Bits of the PDI control byte (offset 7), which is read-only for the MainDevice."""

    DEACTIVATED = 0x01
    REPEAT_ACKNOWLEDGE = 0x02


@dataclass(frozen=True, slots=True)
class Control:
    """The control byte (offset 4), which the SII contains as well.

    Bits 0 and 1 select the buffering mode, bits 2 and 3 the direction. Bits 4 to 6 enable
    interrupts and the watchdog trigger.
    """

    buffering: Buffering
    direction: Direction
    interrupt_ecat: bool = False
    interrupt_pdi: bool = False
    watchdog: bool = False  # a write triggers the process-data watchdog

    @property
    def byte(self) -> int:
        """Value of the register."""
        return (
            self.buffering
            | self.direction << 2
            | self.interrupt_ecat << 4
            | self.interrupt_pdi << 5
            | (WATCHDOG_TRIGGER if self.watchdog else 0)
        )

    @classmethod
    def from_byte(cls, byte: int) -> Control:
        """Return the decoded byte; bit 7 is ignored. Raises DecodeError for an invalid mode."""
        try:
            buffering, direction = Buffering(byte & 0x03), Direction(byte >> 2 & 0x03)
        except ValueError as error:
            raise DecodeError(f"SyncManager control 0x{byte:02X}: {error}") from None
        watchdog = bool(byte & WATCHDOG_TRIGGER)
        return cls(buffering, direction, bool(byte & 0x10), bool(byte & 0x20), watchdog)


# The values of the four bytes are 0x26, 0x22, 0x64 and 0x20.
MAILBOX_OUT = Control(Buffering.MAILBOX, Direction.WRITE, interrupt_pdi=True)
MAILBOX_IN = Control(Buffering.MAILBOX, Direction.READ, interrupt_pdi=True)
OUTPUTS = Control(Buffering.THREE_BUFFERS, Direction.WRITE, interrupt_pdi=True, watchdog=True)
INPUTS = Control(Buffering.THREE_BUFFERS, Direction.READ, interrupt_pdi=True)


_IDLE = Status(0)
_UNTOUCHED = PdiControl(0)


@dataclass(frozen=True, slots=True)
class SyncManager:
    """One SyncManager: its memory area, mode and status."""

    address: int
    length: int
    control: Control
    status: Status = _IDLE
    activation: Activation = Activation.ENABLE
    pdi_control: PdiControl = _UNTOUCHED

    def encode(self) -> bytes:
        """Return the encoded block. Raises ValueError if a field does not fit."""
        try:
            return _BLOCK.pack(
                *(self.address, self.length, self.control.byte),
                *(self.status, self.activation, self.pdi_control),
            )
        except struct.error as error:
            raise ValueError(f"SyncManager: {error}") from None


def decode_sync_manager(data: bytes) -> SyncManager:
    """Decode a SyncManager block of 8 bytes."""
    if len(data) != SIZE:
        raise DecodeError(f"SyncManager: needs {SIZE} bytes, received {len(data)}")
    address, length, control, status, activation, pdi_control = _BLOCK.unpack(data)
    return SyncManager(
        address,
        length,
        Control.from_byte(control),
        Status(status),
        Activation(activation),
        PdiControl(pdi_control),
    )
