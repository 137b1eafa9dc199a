"""Register content of a device, as far as the master has written it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from catenary.capture.register_contents import FmmuWrite, SyncManagerWrite, SyncUnitWrite
from catenary.wire.fmmu import decode_fmmu
from catenary.wire.register import (
    ASSIGN_ACTIVATE,
    FMMU_COUNT,
    PROCESS_RAM,
    SYNC0_CYCLE_TIME,
    SYNC0_START_TIME,
    SYNC1_CYCLE_TIME,
    SYNC_MANAGER_COUNT,
    Register,
    fmmu,
    sync_manager,
)
from catenary.wire.sync_manager import Activation, Buffering, Direction

_FMMUS = tuple(fmmu(k) for k in range(FMMU_COUNT))
_SYNC_MANAGERS = tuple(sync_manager(k) for k in range(SYNC_MANAGER_COUNT))
_STATUS_OFFSETS = range(5, 6)  # of a SyncManager: a write of the status alone changes nothing
_MODE = 0x03
_DIRECTION = 0x0C


class MailboxArea(NamedTuple):
    """Place of a mailbox in the memory of a device."""

    address: int
    length: int


class WrittenRegisters:
    """Owner of the register bytes that a master has written to one device."""

    def __init__(self) -> None:
        self._memory = bytearray(PROCESS_RAM)

    def copy(self) -> WrittenRegisters:
        """Return registers with the same content."""
        new = WrittenRegisters()
        new._memory[:] = self._memory
        return new

    def write(self, address: int, data: bytes) -> None:
        """Store written bytes. Bytes in the process memory are ignored."""
        data = data[: max(PROCESS_RAM - address, 0)]
        self._memory[address : address + len(data)] = data

    def sync_managers(self, address: int, size: int) -> Iterator[SyncManagerWrite]:
        """Yield the SyncManagers of which a write of `size` bytes at `address` has changed a part.

        Args:
            address: Address of the first byte.
            size: Number of bytes.
        """
        for number, register in enumerate(_SYNC_MANAGERS):
            first, last = address - register.address, address + size - register.address
            if first < register.size and last > 0 and (size > 1 or first not in _STATUS_OFFSETS):
                yield self.sync_manager(number)

    def sync_manager(self, number: int) -> SyncManagerWrite:
        """Return the content of a SyncManager."""
        data = self._at(_SYNC_MANAGERS[number])
        enabled = bool(data[6] & Activation.ENABLE)
        start, length = (int.from_bytes(data[i : i + 2], "little") for i in (0, 2))
        return SyncManagerWrite(number, start, length, data[4], enabled)

    def fmmus(self, address: int, size: int) -> Iterator[FmmuWrite]:
        """Yield the FMMUs that a write of `size` bytes at `address` has changed.

        Args:
            address: Address of the first byte.
            size: Number of bytes.
        """
        for number, register in enumerate(_FMMUS):
            if address < register.address + register.size and address + size > register.address:
                yield FmmuWrite(number, decode_fmmu(self._at(register)))

    def sync_unit(self) -> SyncUnitWrite:
        """Return the content of the SYNC unit."""
        return SyncUnitWrite(
            int.from_bytes(self._at(ASSIGN_ACTIVATE), "little"),
            SYNC0_CYCLE_TIME.unpack(self._at(SYNC0_CYCLE_TIME)),
            SYNC1_CYCLE_TIME.unpack(self._at(SYNC1_CYCLE_TIME)),
            SYNC0_START_TIME.unpack(self._at(SYNC0_START_TIME)),
        )

    def mailbox(self, direction: Direction) -> MailboxArea | None:
        """Return the mailbox of a direction; None if no SyncManager was written for it."""
        for number in range(SYNC_MANAGER_COUNT):
            found = self.sync_manager(number)
            is_mailbox = found.control & _MODE == Buffering.MAILBOX
            if is_mailbox and (found.control & _DIRECTION) >> 2 == direction and found.length:
                return MailboxArea(found.address, found.length)
        return None

    def _at(self, register: Register[int] | Register[bytes]) -> bytes:
        return bytes(self._memory[register.address : register.address + register.size])
