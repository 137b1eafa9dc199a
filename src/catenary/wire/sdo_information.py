"""SDO information messages, ETG.1000.6 §5.6.3, which describe the objects of a device.

A reply may consist of fragments. `SdoInformation` is one message. Join the data of the fragments,
then decode it with `decode_object_list`, `decode_object_description` or `decode_entry_description`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from catenary.errors import DecodeError

_HEADER = struct.Struct("<HBBH")  # CoE header, opcode and incomplete bit, reserved, fragments left
_SERVICE = 8
_INCOMPLETE = 0x80
_OBJECT = struct.Struct("<HHBB")
_ENTRY = struct.Struct("<HBBHHH")


class Opcode(IntEnum):
    """Kind of an SDO information message."""

    LIST_REQUEST = 1
    LIST_RESPONSE = 2
    OBJECT_REQUEST = 3
    OBJECT_RESPONSE = 4
    ENTRY_REQUEST = 5
    ENTRY_RESPONSE = 6
    ERROR = 7


class ListType(IntEnum):
    """Kind of the requested object list."""

    LENGTHS = 0  # number of objects of each kind
    ALL = 1
    RXPDO_MAPPABLE = 2
    TXPDO_MAPPABLE = 3
    BACKUP = 4
    SETTINGS = 5


class ObjectCode(IntEnum):
    """Structure of an object."""

    DOMAIN = 2
    DEFTYPE = 5
    DEFSTRUCT = 6
    VAR = 7
    ARRAY = 8
    RECORD = 9


class ValueInfo(IntFlag):
    """Flags that select optional fields of an entry description."""

    NONE = 0
    ACCESS_RIGHTS = 0x01
    CATEGORY = 0x02
    MAPPABLE = 0x04
    UNIT = 0x08
    DEFAULT = 0x10
    MINIMUM = 0x20
    MAXIMUM = 0x40


class Access(IntFlag):
    """Bits of the object access word of an entry."""

    READ_PRE_OP = 0x0001
    READ_SAFE_OP = 0x0002
    READ_OP = 0x0004
    WRITE_PRE_OP = 0x0008
    WRITE_SAFE_OP = 0x0010
    WRITE_OP = 0x0020
    RXPDO_MAPPABLE = 0x0040
    TXPDO_MAPPABLE = 0x0080
    BACKUP = 0x0100
    SETTING = 0x0200


@dataclass(frozen=True, slots=True)
class SdoInformation:
    """One message, or one fragment of a reply.

    If `incomplete` (bit 7 of the opcode) is set, more fragments follow.
    """

    opcode: Opcode
    data: bytes
    fragments_left: int = 0
    incomplete: bool = False

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        opcode = self.opcode | (_INCOMPLETE if self.incomplete else 0)
        try:
            return _HEADER.pack(_SERVICE << 12, opcode, 0, self.fragments_left) + self.data
        except struct.error as error:
            raise ValueError(f"SDO information: {error}") from None


def decode_sdo_information(data: bytes) -> SdoInformation:
    """Decode the data of a mailbox message, including the CoE header."""
    if len(data) < _HEADER.size:
        raise DecodeError(f"SDO information: needs {_HEADER.size} bytes, received {len(data)}")
    header, opcode, _, fragments_left = _HEADER.unpack_from(data)
    if header >> 12 != _SERVICE:
        raise DecodeError(f"SDO information: CoE service {header >> 12} instead of {_SERVICE}")
    try:
        kind = Opcode(opcode & ~_INCOMPLETE)
    except ValueError:
        raise DecodeError(f"SDO information: unknown opcode {opcode & ~_INCOMPLETE}") from None
    payload = bytes(data[_HEADER.size :])
    return SdoInformation(kind, payload, fragments_left, bool(opcode & _INCOMPLETE))


def list_request(kind: ListType) -> SdoInformation:
    """Return the request for an object list: the indices of all objects of a kind."""
    return SdoInformation(Opcode.LIST_REQUEST, struct.pack("<H", kind))


def object_request(index: int) -> SdoInformation:
    """Return the request for the description of an object."""
    return SdoInformation(Opcode.OBJECT_REQUEST, struct.pack("<H", index))


def entry_request(index: int, subindex: int, info: ValueInfo = ValueInfo.NONE) -> SdoInformation:
    """Return the request for the description of an entry.

    Args:
        index: Index of the object.
        subindex: Subindex of the entry.
        info: Optional fields that the description must contain.
    """
    return SdoInformation(Opcode.ENTRY_REQUEST, struct.pack("<HBB", index, subindex, info))


@dataclass(frozen=True, slots=True)
class ObjectList:
    """Indices of the objects of a kind; for LENGTHS, the number of objects of each other kind."""

    kind: ListType
    indices: tuple[int, ...]

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if an index does not fit."""
        try:
            return struct.pack(f"<{1 + len(self.indices)}H", self.kind, *self.indices)
        except struct.error as error:
            raise ValueError(f"object list: {error}") from None


def decode_object_list(data: bytes) -> ObjectList:
    """Decode the joined data of all LIST_RESPONSE fragments."""
    if len(data) < 2:
        raise DecodeError(f"object list: needs at least 2 bytes, received {len(data)}")
    # A truncated list may end in the middle of an index.
    kind, *indices = struct.unpack_from(f"<{len(data) // 2}H", data)
    try:
        return ObjectList(ListType(kind), tuple(indices))
    except ValueError:
        raise DecodeError(f"object list: unknown kind {kind}") from None


@dataclass(frozen=True, slots=True)
class ObjectDescription:
    """Description of an object. For `data_type`, see `types.by_index`."""

    index: int
    data_type: int
    maximum_subindex: int
    object_code: int  # an ObjectCode, or an undefined number from the device
    name: str = ""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        try:
            head = _OBJECT.pack(self.index, self.data_type, self.maximum_subindex, self.object_code)
            return head + self.name.encode("latin-1")
        except (struct.error, UnicodeEncodeError) as error:
            raise ValueError(f"object description: {error}") from None


def decode_object_description(data: bytes) -> ObjectDescription:
    """Decode the joined data of all OBJECT_RESPONSE fragments."""
    if len(data) < _OBJECT.size:
        raise DecodeError(f"object description: needs {_OBJECT.size} bytes, received {len(data)}")
    name = bytes(data[_OBJECT.size :]).decode("latin-1")
    index, data_type, maximum_subindex, object_code = _OBJECT.unpack_from(data)
    return ObjectDescription(index, data_type, maximum_subindex, object_code, name)


@dataclass(frozen=True, slots=True)
class EntryDescription:
    """Description of an entry. `rest` contains the optional fields in `info`, then the name."""

    index: int
    subindex: int
    info: ValueInfo
    data_type: int
    bit_length: int
    access: Access
    rest: bytes = b""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        try:
            head = _ENTRY.pack(
                *(self.index, self.subindex, self.info),
                *(self.data_type, self.bit_length, self.access),
            )
        except struct.error as error:
            raise ValueError(f"entry description: {error}") from None
        return head + self.rest

    @property
    def name(self) -> str:
        """Name of the entry, which follows the selected fields in `rest`."""
        size = (self.bit_length + 7) // 8
        values = (ValueInfo.DEFAULT, ValueInfo.MINIMUM, ValueInfo.MAXIMUM)
        skipped = (4 if self.info & ValueInfo.UNIT else 0) + size * sum(
            bool(self.info & value) for value in values
        )
        return self.rest[skipped:].decode("latin-1")


def decode_entry_description(data: bytes) -> EntryDescription:
    """Decode the joined data of all ENTRY_RESPONSE fragments."""
    if len(data) < _ENTRY.size:
        raise DecodeError(f"entry description: needs {_ENTRY.size} bytes, received {len(data)}")
    index, subindex, info, data_type, bit_length, access = _ENTRY.unpack_from(data)
    return EntryDescription(
        *(index, subindex, ValueInfo(info), data_type, bit_length, Access(access)),
        bytes(data[_ENTRY.size :]),
    )


def decode_error(data: bytes) -> int | None:
    """Return the abort code in the data of an ERROR message; None if the data is incomplete.

    KickCAT (CoE/mailbox/response.cc, SDOInformationMessage::abort) appends the code, but the length
    in its header does not include it. The message then ends before the code.
    """
    return int.from_bytes(data[:4], "little") if len(data) >= 4 else None
