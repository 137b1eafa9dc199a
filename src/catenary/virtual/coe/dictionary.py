"""Object dictionary of a device, ETG.1000.6 §5.6.7, with the access rules of its entries."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

VARIABLE, ARRAY, RECORD = 7, 8, 9

# Data types, ETG.1020: number → (bits, struct format)
FORMATS = {
    0x0001: (1, "<B"),
    0x0002: (8, "<b"),
    0x0003: (16, "<h"),
    0x0004: (32, "<i"),
    0x0005: (8, "<B"),
    0x0006: (16, "<H"),
    0x0007: (32, "<I"),
    0x0008: (32, "<f"),
    0x0015: (64, "<q"),
    0x001B: (64, "<Q"),
}
BOOLEAN, INTEGER8, INTEGER16, INTEGER32 = 1, 2, 3, 4
UNSIGNED8, UNSIGNED16, UNSIGNED32, REAL32 = 5, 6, 7, 8
UNSIGNED64 = 0x1B
VISIBLE_STRING, OCTET_STRING = 9, 10
SIGNED = {INTEGER8, INTEGER16, INTEGER32, 0x0015}

SLOT_BITS = 64  # of a slot of the model
READ_ANY, WRITE_ANY, WRITE_PRE_OP = 0x07, 0x38, 0x08
MAP_RX, MAP_TX = 0x40, 0x80

TOGGLE = 0x05030000
UNKNOWN_COMMAND = 0x05040001
WRITE_ONLY, READ_ONLY = 0x06010001, 0x06010002
SUBINDEX_0_FIRST = 0x06010003
NO_COMPLETE_ACCESS = 0x06010004
NO_OBJECT = 0x06020000
CANNOT_BE_MAPPED, MAPPING_TOO_LONG = 0x06040041, 0x06040042
WRONG_LENGTH, TOO_LONG, TOO_SHORT = 0x06070010, 0x06070012, 0x06070013
NO_SUBINDEX = 0x06090011
OUT_OF_RANGE = 0x06090030
WRONG_STATE = 0x08000022


def slot_value(data: bytes, bits: int, signed: bool) -> int:
    """Return the number in the lowest `bits` of the data, as a slot of the model stores it.

    Slots are signed and have 64 bits. A number of 64 bits therefore always has a sign.
    """
    bits = min(bits, SLOT_BITS)
    value = int.from_bytes(data, "little") & ((1 << bits) - 1)
    sign = 1 << bits >> 1 if signed or bits == SLOT_BITS else 0
    return value - (1 << bits) if value & sign else value


class Abort(Exception):
    """SDO abort with which the device answers."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = code


@dataclass(frozen=True, slots=True)
class Entry:
    """Subindex of an object. `read` returns its bytes; `write` stores bytes or raises Abort."""

    name: str
    data_type: int
    bits: int
    access: int
    read: Callable[[], bytes]
    write: Callable[[bytes], None] | None = None
    slot: int = -1  # slot of the process data; -1: none
    signed: bool = False  # True if the slot has a sign
    unlisted: int = 0  # mapping flags that the description of the entry does not show

    @property
    def mappable(self) -> int:
        """Access flags with those for PDOs that the description does not show."""
        return self.access | self.unlisted


@dataclass(slots=True)
class Object:
    index: int
    name: str
    code: int
    data_type: int
    entries: dict[int, Entry] = field(default_factory=dict)
    maximum: int | None = None  # highest subindex in the description; None: that of the entries
    described: bool = True  # False: requests for its descriptions are refused
    complete_access: bool = True

    @property
    def highest(self) -> int:
        if self.maximum is not None:
            return self.maximum
        return 0 if self.code == VARIABLE else max(self.entries)


def constant(name: str, data_type: int, value: bytes, access: int = READ_ANY) -> Entry:
    """Return an entry with constant bytes."""
    return Entry(name, data_type, 8 * len(value), access, lambda: value)


def number(name: str, data_type: int, value: int, access: int = READ_ANY) -> Entry:
    """Return an entry with a constant number."""
    bits, form = FORMATS[data_type]
    packed = struct.pack(form, value)
    return Entry(name, data_type, bits, access, lambda: packed)


def text(name: str, value: str) -> Entry:
    """Return an entry with a constant string."""
    return constant(name, VISIBLE_STRING, value.encode("latin-1", "replace"))


class Variable:
    """Bytes of one writable entry. `limit`: maximum length, at least that of the first value."""

    def __init__(self, value: bytes, *, variable_length: bool = False, limit: int = 0) -> None:
        self.value = value
        self._limit = max(len(value), limit)
        self._variable_length = variable_length

    def read(self) -> bytes:
        return self.value

    def write(self, data: bytes) -> None:
        if len(data) > self._limit:
            raise Abort(TOO_LONG)
        if len(data) < self._limit and not self._variable_length:
            raise Abort(TOO_SHORT)
        self.value = data


def stored(name: str, data_type: int, value: bytes, *, variable_length: bool = False) -> Entry:
    """Return an entry that stores the bytes written to it.

    Args:
        name: Name of the entry.
        data_type: CANopen data type.
        value: Initial bytes, which determine the maximum length.
        variable_length: True accepts fewer bytes.
    """
    variable = Variable(value, variable_length=variable_length)
    access = READ_ANY | WRITE_ANY
    return Entry(name, data_type, 8 * len(value), access, variable.read, variable.write)


class Dictionary:
    """Objects of a device. `state` returns the AL state for access checks."""

    def __init__(self, state: Callable[[], int]) -> None:
        self._state = state
        self.objects: dict[int, Object] = {}

    def add(self, index: int, name: str, entries: dict[int, Entry], *, code: int = RECORD) -> None:
        data_type = entries[0].data_type if code == VARIABLE else entries[max(entries)].data_type
        self.objects[index] = Object(index, name, code, data_type, entries)

    def add_variable(self, index: int, entry: Entry) -> None:
        self.add(index, entry.name, {0: entry}, code=VARIABLE)

    def add_record(
        self, index: int, name: str, entries: list[Entry], *, code: int = RECORD
    ) -> None:
        """Add an object with entries from subindex 1 on. Subindex 0 is their number.

        Args:
            index: Index of the object.
            name: Name of the object.
            entries: Entries from subindex 1 on.
            code: Object code: RECORD or ARRAY.
        """
        counted = {0: number("Number of entries", UNSIGNED8, len(entries))}
        self.add(index, name, counted | dict(enumerate(entries, 1)), code=code)

    def entry(self, index: int, subindex: int) -> Entry:
        if index not in self.objects:
            raise Abort(NO_OBJECT)
        if subindex not in self.objects[index].entries:
            raise Abort(NO_SUBINDEX)
        return self.objects[index].entries[subindex]

    def known_entry(self, index: int, subindex: int) -> Entry | None:
        """Return an entry; None if it does not exist."""
        found = self.objects.get(index)
        return None if found is None else found.entries.get(subindex)

    def _state_bit(self) -> int:
        return {2: 1, 4: 2, 8: 4}.get(self._state(), 0)

    def read(self, index: int, subindex: int) -> bytes:
        entry = self.entry(index, subindex)
        rights = entry.access & (READ_ANY | WRITE_ANY)  # some devices state none
        if rights and not rights & READ_ANY:
            raise Abort(WRITE_ONLY)
        if rights and not rights & self._state_bit():
            raise Abort(WRONG_STATE)
        return entry.read()

    def write(self, index: int, subindex: int, data: bytes) -> None:
        entry = self.entry(index, subindex)
        if entry.write is None or not entry.access & WRITE_ANY:
            raise Abort(READ_ONLY)
        if not entry.access & self._state_bit() << 3:
            raise Abort(WRONG_STATE)
        if entry.data_type in FORMATS and len(data) * 8 != max(entry.bits, 8):
            raise Abort(TOO_LONG if len(data) * 8 > entry.bits else TOO_SHORT)
        entry.write(data)

    def read_complete(self, index: int, first: int) -> bytes:
        """Return the values of all subindices from `first` on, for complete access.

        Args:
            index: Index of the object.
            first: First subindex: 0 or 1. Subindex 0 takes 16 bits.

        Raises:
            Abort: The object does not exist or does not support complete access.
        """
        if index not in self.objects:
            raise Abort(NO_OBJECT)
        entries = self.objects[index].entries
        if self.objects[index].code == VARIABLE or not self.objects[index].complete_access:
            raise Abort(NO_COMPLETE_ACCESS)
        value, bit = 0, 0
        for subindex in sorted(entries):
            if subindex < first:
                continue
            entry = entries[subindex]
            raw = entry.read() if entry.access & READ_ANY else bytes((entry.bits + 7) // 8)
            width = 16 if subindex == 0 else entry.bits
            value |= (int.from_bytes(raw, "little") & (1 << width) - 1) << bit
            bit += width
        return value.to_bytes((bit + 7) // 8, "little")

    def write_complete(self, index: int, first: int, data: bytes) -> None:
        """Write the subindices in `data` with complete access, except those that are read-only.

        If subindex 0 is writable, clear it first and set it last, as PDO objects require.

        Args:
            index: Index of the object.
            first: First subindex in the data: 0 or 1.
            data: Values of the subindices; subindex 0 takes 16 bits.

        Raises:
            Abort: The object or a value is refused.
        """
        if index not in self.objects:
            raise Abort(NO_OBJECT)
        entries = self.objects[index].entries
        is_record = self.objects[index].code != VARIABLE and 0 in entries
        is_record = is_record and self.objects[index].complete_access
        if not is_record or any(e.bits % 8 for e in entries.values()):
            raise Abort(NO_COMPLETE_ACCESS)
        count = data[:1] if first == 0 else b""
        at = 2 if first == 0 else 0
        writable_count = entries[0].write is not None
        if writable_count:
            self.write(index, 0, b"\0")
        written = 0
        for subindex in sorted(entries)[1:]:
            size = entries[subindex].bits // 8
            if at + size > len(data):
                break
            if entries[subindex].write is not None:
                self.write(index, subindex, data[at : at + size])
            at += size
            written += 1
        if at < len(data):
            raise Abort(TOO_LONG)
        if writable_count:
            self.write(index, 0, count or bytes([written]))
