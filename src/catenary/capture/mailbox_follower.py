"""Mailbox messages of one device, found by its SyncManagers or by their content."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.capture.contents import Content
from catenary.capture.mailbox_contents import EmergencyReceived, MailboxFault, MailboxMessage
from catenary.capture.mailbox_text import service_text
from catenary.capture.registers import MailboxArea, WrittenRegisters
from catenary.capture.sdo_follower import SdoFollower
from catenary.capture.transaction import Transaction
from catenary.errors import DecodeError
from catenary.wire.coe import Emergency, Message, decode_coe
from catenary.wire.mailbox import Mailbox, Type, decode_error, decode_mailbox
from catenary.wire.register import PROCESS_RAM, SYNC_MANAGER_COUNT, sync_manager
from catenary.wire.sync_manager import Direction

_LAST = sync_manager(SYNC_MANAGER_COUNT - 1)
_SYNC_MANAGERS = range(sync_manager(0).address, _LAST.address + _LAST.size)


class MailboxFollower:
    """Owner of the mailboxes of one device, and of its last message."""

    def __init__(self, registers: WrittenRegisters) -> None:
        self._registers = registers
        self._areas: dict[Direction, MailboxArea | None] = dict.fromkeys(Direction)
        self._last_read = b""
        self.sdo = SdoFollower()

    def configure(self, address: int, size: int) -> None:
        """Read the mailboxes again, after a write to a register.

        Args:
            address: Address of the first byte.
            size: Number of bytes.
        """
        if address < _SYNC_MANAGERS.stop and address + size > _SYNC_MANAGERS.start:
            self._areas = {each: self._registers.mailbox(each) for each in Direction}

    def follow(self, each: Transaction) -> Iterator[Content]:
        """Follow a datagram to or from the process memory of the device."""
        if each.ado < PROCESS_RAM or not each.accepted:
            return
        if each.written is not None and self._is_mailbox(each, each.written, Direction.WRITE):
            yield from self._decode(each.written, to_device=True, time_ns=each.time_ns)
        if each.read is not None and self._is_mailbox(each, each.read, Direction.READ):
            if _is_repeated(each.read, self._last_read):
                return
            self._last_read = each.read
            yield from self._decode(each.read, to_device=False, time_ns=each.time_ns)

    def _is_mailbox(self, each: Transaction, data: bytes, direction: Direction) -> bool:
        area = self._areas[direction]
        if area is not None:
            return each.ado == area.address
        return _resembles_coe(data)

    def _decode(self, data: bytes, *, to_device: bool, time_ns: int) -> Iterator[Content]:
        try:
            mailbox = decode_mailbox(data)
        except DecodeError:
            return
        if mailbox.type is Type.ERROR:
            yield _fault(mailbox, to_device=to_device)
            return
        message = _decode_coe(mailbox)
        if message is None:
            yield _other(mailbox, to_device=to_device)
        elif isinstance(message, Emergency):
            yield EmergencyReceived(message.error_code, message.error_register, message.data)
        elif to_device:
            yield from self.sdo.request(message, time_ns)
        else:
            yield from self.sdo.response(message, time_ns)


def _is_repeated(data: bytes, last: bytes) -> bool:
    """Return True if a device has sent the same message again. A counter of 0 is not counted."""
    return data == last and len(data) > 5 and bool(data[5] & 0x70)


def _resembles_coe(data: bytes) -> bool:
    """Return True for a CoE message, if the capture does not contain the SyncManagers."""
    try:
        mailbox = decode_mailbox(data)
    except DecodeError:
        return False
    return mailbox.type is Type.COE and _decode_coe(mailbox) is not None


def _decode_coe(mailbox: Mailbox) -> Message | None:
    if mailbox.type is not Type.COE:
        return None
    try:
        return decode_coe(mailbox.data)
    except DecodeError:
        return None


def _fault(mailbox: Mailbox, *, to_device: bool) -> Content:
    try:
        return MailboxFault(decode_error(mailbox.data).code)
    except DecodeError:
        return _other(mailbox, to_device=to_device)


def _other(mailbox: Mailbox, *, to_device: bool) -> MailboxMessage:
    return MailboxMessage(mailbox.type, to_device, len(mailbox.data), service_text(mailbox))
