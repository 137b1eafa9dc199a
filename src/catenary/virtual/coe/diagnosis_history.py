"""Diagnosis history of a virtual device, ETG.1020 §13: objects 0x10F3 and 0x10F8.

The module is independent of `catenary.wire.diagnosis_history`, the client side.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from catenary.virtual.coe.dictionary import (
    BOOLEAN,
    FORMATS,
    MAP_TX,
    NO_SUBINDEX,
    OCTET_STRING,
    OUT_OF_RANGE,
    READ_ANY,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_ANY,
    Abort,
    Dictionary,
    Entry,
    number,
)

INFO, WARNING, ERROR = 0, 1, 2
SEVERITIES = ("info", "warning", "error")
HISTORY, TIMESTAMP = 0x10F3, 0x10F8
FIRST = 6  # subindex of the first message
MESSAGES_MAX = 250
ACKNOWLEDGE_MODE, OVERFLOW = 0x10, 0x20
WRITABLE_FLAGS = 0x1E  # severities that are not stored, and the mode; this device sends no copies
LOCAL_TIME = 0x10
TOO_HIGH, TOO_LOW = 0x06090031, 0x06090032
UNSIGNED64 = 0x001B
ERROR_CODE = 0xE800  # low word; the high word is an emergency error code

# Texts of our own kinds of devices, for an ESI (`DiagMessage`), by text ID.
REFUSED, TIMED_OUT, SYNC_LOST, FAULT = range(1, 5)
TEXTS = {
    REFUSED: "Request for state %d refused with AL status code 0x%04X",
    TIMED_OUT: "The watchdog of the outputs has expired",
    SYNC_LOST: "Synchronisation lost, AL status code 0x%04X",
    FAULT: "Fault 0x%04X",
}

Number = tuple[int, int]  # data type and value of a parameter


@dataclass(frozen=True, slots=True)
class HistoryOptions:
    """Form of the history.

    With `message_bytes`, messages have a fixed size and end with zeros, as in Beckhoff's terminals.
    With 0, they have their own length, and subindex 0 is the highest subindex with a message, as in
    Beckhoff's slave stack code.
    """

    messages: int = 16
    message_bytes: int = 32

    def __post_init__(self) -> None:
        if not 0 <= self.messages <= MESSAGES_MAX:
            raise ValueError(f"messages must be 0 to {MESSAGES_MAX}, not {self.messages}")
        if self.message_bytes and not 16 <= self.message_bytes <= 64:
            raise ValueError(f"message_bytes must be 0, or 16 to 64, not {self.message_bytes}")


NO_HISTORY = HistoryOptions(messages=0)


class DiagnosisHistory:
    """Ring of messages. `now_ns` returns the time of the device [ns]."""

    def __init__(
        self,
        dictionary: Dictionary,
        now_ns: Callable[[], int],
        options: HistoryOptions,
    ) -> None:
        self._now_ns = now_ns
        self._options = options
        self._slots: list[bytes] = [b""] * options.messages
        self._order: list[int] = []  # subindices with a message, oldest first
        self._acknowledged = 0  # subindex; 0: none
        self._unread = False
        self._flags = 0
        self._add_objects(dictionary)

    def add(
        self, severity: int, code: int, text_id: int, parameters: Sequence[Number] = ()
    ) -> None:
        """Store a message, unless its severity is disabled or the ring has no room.

        Args:
            severity: INFO, WARNING or ERROR.
            code: Diagnosis code.
            text_id: Text of the message in the ESI.
            parameters: Data type and value of each parameter.
        """
        if self._flags >> (1 + severity) & 1:
            return
        packed = b"".join(
            struct.pack("<H", kind) + struct.pack(FORMATS[kind][1], value)
            for kind, value in parameters
        )
        flags = severity | LOCAL_TIME | len(parameters) << 8
        message = struct.pack("<IHHQ", code, flags, text_id, self._now_ns()) + packed
        size = self._options.message_bytes
        self._store(message[:size].ljust(size, b"\0") if size else message)

    @property
    def newest(self) -> int:
        """Subindex of the newest message; 0 without one."""
        return self._order[-1] if self._order else 0

    def _store(self, message: bytes) -> None:
        count = self._options.messages
        subindex = FIRST + (self.newest - FIRST + 1) % count if self._order else FIRST
        if subindex in self._order:  # the ring is full: this is the oldest message
            unacknowledged = self._is_unacknowledged(subindex)
            if unacknowledged:
                self._flags |= OVERFLOW
                if self._flags & ACKNOWLEDGE_MODE:
                    return
            if unacknowledged or self._acknowledged == subindex:
                self._acknowledged = 0
            self._order.remove(subindex)
        self._slots[subindex - FIRST] = message
        self._order.append(subindex)
        self._unread = True

    def _is_unacknowledged(self, subindex: int) -> bool:
        if self._acknowledged not in self._order:
            return True
        return self._order.index(subindex) > self._order.index(self._acknowledged)

    # -- for the objects -----------------------------------------------------------------------

    def _available(self) -> int:
        if self._flags & ACKNOWLEDGE_MODE:
            return int(bool(self._order) and self._acknowledged != self.newest)
        return int(self._unread)

    def _acknowledge(self, subindex: int) -> None:
        last = FIRST + self._options.messages - 1
        if subindex == 0:
            self._clear()
        elif subindex < FIRST:
            raise Abort(TOO_LOW)
        elif subindex > last:
            raise Abort(TOO_HIGH)
        elif subindex not in self._order:
            raise Abort(OUT_OF_RANGE)
        else:
            self._acknowledged = subindex
            self._flags &= ~OVERFLOW

    def _clear(self) -> None:
        """Delete all messages, or the acknowledged ones in the acknowledge mode."""
        kept: list[int] = []
        if self._flags & ACKNOWLEDGE_MODE:
            kept = [each for each in self._order if self._is_unacknowledged(each)]
        for subindex in self._order:
            if subindex not in kept:
                self._slots[subindex - FIRST] = b""
        self._order = kept
        self._acknowledged = 0
        self._unread = self._unread and bool(kept)
        self._flags &= ~OVERFLOW

    def _set_flags(self, flags: int) -> None:
        if (flags ^ self._flags) & ~WRITABLE_FLAGS:
            raise Abort(OUT_OF_RANGE)
        self._flags = flags

    def _message(self, subindex: int) -> bytes:
        data = self._slots[subindex - FIRST]
        size = self._options.message_bytes
        if not data and not size:
            raise Abort(NO_SUBINDEX)
        if subindex == self.newest:
            self._unread = False
        return data or bytes(size)

    def _highest(self) -> int:
        if self._options.message_bytes:
            return FIRST - 1 + self._options.messages
        return max(self._order, default=FIRST - 1)

    def _add_objects(self, dictionary: Dictionary) -> None:
        writable = READ_ANY | WRITE_ANY
        entries = {
            0: _entry("Number of entries", UNSIGNED8, self._highest),
            1: number("Maximum messages", UNSIGNED8, self._options.messages),
            2: _entry("Newest message", UNSIGNED8, lambda: self.newest),
            3: _entry(
                *("Newest acknowledged message", UNSIGNED8, lambda: self._acknowledged),
                access=writable,
                write=self._acknowledge,
            ),
            4: _entry("New messages available", BOOLEAN, self._available, access=READ_ANY | MAP_TX),
            5: _entry(
                "Flags", UNSIGNED16, lambda: self._flags, access=writable, write=self._set_flags
            ),
        }
        for subindex in range(FIRST, FIRST + self._options.messages):
            entries[subindex] = self._message_entry(subindex)
        dictionary.add(HISTORY, "Diagnosis history", entries)
        dictionary.objects[HISTORY].complete_access = False
        dictionary.add_variable(
            TIMESTAMP, _entry("Timestamp object", UNSIGNED64, lambda: self._now_ns())
        )

    def _message_entry(self, subindex: int) -> Entry:
        bits = 8 * self._options.message_bytes
        name = f"Diagnosis message {subindex - FIRST + 1:03d}"
        return Entry(name, OCTET_STRING, bits, READ_ANY, lambda: self._message(subindex))


def _entry(
    name: str,
    data_type: int,
    read: Callable[[], int],
    *,
    access: int = READ_ANY,
    write: Callable[[int], None] | None = None,
) -> Entry:
    bits, form = FORMATS[data_type]

    def pack() -> bytes:
        return struct.pack(form, read())

    def unpack(data: bytes) -> None:
        if write is not None:
            write(int.from_bytes(data, "little"))

    return Entry(name, data_type, bits, access, pack, unpack if write else None)


def error_code_of(code: int) -> int:
    """Return the diagnosis code for an emergency error code."""
    return code << 16 | ERROR_CODE


def word(value: int) -> Number:
    """Return a parameter of 16 bits."""
    return UNSIGNED16, value & 0xFFFF


def double_word(value: int) -> Number:
    """Return a parameter of 32 bits."""
    return UNSIGNED32, value & 0xFFFF_FFFF
