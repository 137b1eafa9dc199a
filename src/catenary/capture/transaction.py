"""A datagram with the data that was sent and the data that returned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from catenary.capture.direction import CapturedFrame
from catenary.capture.pairing import FramePair
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.register import AL_CONTROL, AL_STATUS, Register

_BY_POSITION = frozenset((EcatCommand.APRD, EcatCommand.APWR, EcatCommand.APRW, EcatCommand.ARMW))
_BY_STATION = frozenset((EcatCommand.FPRD, EcatCommand.FPWR, EcatCommand.FPRW, EcatCommand.FRMW))
_BROADCAST = frozenset((EcatCommand.BRD, EcatCommand.BWR, EcatCommand.BRW))
# SOEM writes one byte of AL control; the second byte of both is reserved.
_FIRST_BYTE_SUFFICES = (AL_CONTROL, AL_STATUS)
_MULTIPLE = frozenset((EcatCommand.ARMW, EcatCommand.FRMW))


@dataclass(frozen=True, slots=True)
class Transaction:
    """A datagram on its way through the segment.

    `written` is the data that the master sent, `read` the data that returned. Each is None if the
    command does not transfer it, or if the capture does not contain the frame. `working_counter` is
    None without an answer.
    """

    time_ns: int
    packet: int
    command: EcatCommand
    address: int  # 32 bits, as sent
    length: int
    written: bytes | None
    read: bytes | None
    working_counter: int | None

    @property
    def adp(self) -> int:
        """Position or station address."""
        return self.address & 0xFFFF

    @property
    def ado(self) -> int:
        """Address in the memory of the device."""
        return self.address >> 16

    @property
    def by_position(self) -> bool:
        """True if the command addresses a device by its position."""
        return self.command in _BY_POSITION

    @property
    def by_station(self) -> bool:
        """True if the command addresses a device by its station address."""
        return self.command in _BY_STATION

    @property
    def is_broadcast(self) -> bool:
        """True if the command addresses all devices."""
        return self.command in _BROADCAST

    @property
    def position(self) -> int:
        """Position of the addressed device, from 0, if the command addresses a position."""
        return -self.adp & 0xFFFF

    @property
    def accepted(self) -> bool:
        """False if the frame returned, but no device processed the datagram."""
        return self.working_counter != 0

    def was_read(self, register: Register[Any]) -> bytes | None:
        """Return the content of a register that was read; None if it was not."""
        return self._part(self.read, register) if self.working_counter else None

    def was_written(self, register: Register[Any]) -> bytes | None:
        """Return the content of a register that was written; None if it was not."""
        return self._part(self.written, register)

    def _part(self, data: bytes | None, register: Register[Any]) -> bytes | None:
        start = register.address - (self.address >> 16)
        if data is None or not 0 <= start < len(data):
            return None
        size = 1 if register in _FIRST_BYTE_SUFFICES else register.size
        if start + size > len(data):
            return None
        return data[start : start + register.size]


def transactions(pair: FramePair, device_count: int | None) -> Iterator[Transaction]:
    """Yield the datagrams of a frame, without those of process data and NOP.

    Args:
        pair: The sent and the returned frame.
        device_count: Number of devices, which restores the position in an answer without its sent
            frame; None if unknown.
    """
    base = pair.answer or pair.sent
    assert base is not None
    for i, datagram in enumerate(base.frame.datagrams):
        if datagram.command.is_logical or datagram.command is EcatCommand.NOP:
            continue
        sent = pair.sent.frame.datagrams[i] if pair.sent else None
        answer = datagram if pair.answer else None
        yield _transaction(base, sent, answer, device_count)


def _transaction(
    base: CapturedFrame, sent: Datagram | None, answer: Datagram | None, device_count: int | None
) -> Transaction:
    datagram = sent or answer
    assert datagram is not None
    command, address = datagram.command, datagram.address
    if sent is None and command in _BY_POSITION and device_count is not None:
        # each device has incremented the position
        address = address & 0xFFFF_0000 | (address - device_count) & 0xFFFF
    # An answer alone also contains the written data, except where the device replaces it.
    returned_as_sent = command.writes and not command.reads and answer is not None
    written = sent.data if sent else answer.data if returned_as_sent and answer else None
    return Transaction(
        base.time_ns,
        base.number,
        command,
        address,
        len(datagram.data),
        written if command.writes and command not in _MULTIPLE else None,
        answer.data if answer and command.reads else None,
        answer.working_counter if answer else None,
    )
