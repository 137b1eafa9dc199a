"""SDO information services, ETG.1000.6 §5.6.3: which objects a device has, and what they are.

An answer may come in fragments, one mailbox message each, without being asked for again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from catenary.errors import DecodeError, MailboxError, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively, further
from catenary.procedure.sdo import decoded, refused
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.sdo_information import (
    EntryDescription,
    ListType,
    ObjectCode,
    ObjectDescription,
    Opcode,
    SdoInformation,
    ValueInfo,
    decode_entry_description,
    decode_error,
    decode_object_description,
    decode_object_list,
    entry_request,
    list_request,
    object_request,
)

T = TypeVar("T")

ABOUT = {Opcode.LIST_RESPONSE: 2, Opcode.OBJECT_RESPONSE: 2, Opcode.ENTRY_RESPONSE: 3}  # bytes
ANSWER_MAX = 2 + 2 * 0x1_0000  # bytes: the list of all indices there can be


@dataclass(frozen=True, slots=True)
class DescribedObject:
    """An object and its entries, by subindex; a variable has one."""

    description: ObjectDescription
    entries: tuple[EntryDescription, ...]

    @property
    def index(self) -> int:
        return self.description.index

    @property
    def name(self) -> str:
        return self.description.name


def read_object_list(
    channel: MailboxChannel, kind: ListType = ListType.ALL
) -> Procedure[tuple[int, ...]]:
    """The indices of the objects of a kind. SdoAbort where the device refuses."""
    data = yield from _ask(channel, list_request(kind), Opcode.LIST_RESPONSE, (0, 0))
    return _understood(channel, decode_object_list, data).indices


def read_object_description(channel: MailboxChannel, index: int) -> Procedure[ObjectDescription]:
    """What an object is. SdoAbort where the device has none."""
    data = yield from _ask(channel, object_request(index), Opcode.OBJECT_RESPONSE, (index, 0))
    return _understood(channel, decode_object_description, data)


def read_entry_description(
    channel: MailboxChannel, index: int, subindex: int, info: ValueInfo = ValueInfo.NONE
) -> Procedure[EntryDescription]:
    """What an entry is. SdoAbort where the device has none."""
    request = entry_request(index, subindex, info)
    data = yield from _ask(channel, request, Opcode.ENTRY_RESPONSE, (index, subindex))
    return _understood(channel, decode_entry_description, data)


def describe_object(channel: MailboxChannel, index: int) -> Procedure[DescribedObject]:
    """An object with all its entries; subindices that the device does not know are left out, as
    arrays may have gaps."""
    description = yield from read_object_description(channel, index)
    single = description.object_code == ObjectCode.VAR
    last = 0 if single else description.maximum_subindex
    entries = []
    for subindex in range(last + 1):
        try:
            entries.append((yield from read_entry_description(channel, index, subindex)))
        except SdoAbort:
            continue
    return DescribedObject(description, tuple(entries))


def list_objects(
    channel: MailboxChannel, kind: ListType = ListType.ALL
) -> Procedure[tuple[ObjectDescription, ...]]:
    """What all objects of a kind are. Those that the device lists and then denies are left out."""
    found = []
    for index in (yield from read_object_list(channel, kind)):
        try:
            found.append((yield from read_object_description(channel, index)))
        except SdoAbort:
            continue
    return tuple(found)


def _ask(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[bytes]:
    return exclusively(channel, _exchange(channel, request, expected, place))


def _exchange(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[bytes]:
    """The joined data of all fragments of the answer."""

    def accept_part(mailbox: Mailbox) -> SdoInformation | None:
        message = decoded(channel, mailbox)
        if not isinstance(message, SdoInformation):
            return None
        return message if message.opcode in (expected, Opcode.ERROR) else None

    def accept_first(mailbox: Mailbox) -> SdoInformation | None:
        # Every answer repeats what it is about: list type, index, or index and subindex.
        part, about = accept_part(mailbox), request.data[: ABOUT[expected]]
        late = part and part.opcode is expected and not part.data.startswith(about)
        return None if late else part

    part: SdoInformation = yield from converse(channel, Type.COE, request.encode(), accept_first)
    data = bytearray(_content(channel, part, place))
    while part.incomplete:
        part = yield from further(channel, accept_part)
        content = _content(channel, part, place)
        if not content or len(data) + len(content) > ANSWER_MAX:
            raise MailboxError(
                f"{channel.station}: an answer of SDO information without an end",
                hint="its firmware is at fault; read single objects instead",
            )
        data += content
    return bytes(data)


def _content(channel: MailboxChannel, part: SdoInformation, place: tuple[int, int]) -> bytes:
    if part.opcode is not Opcode.ERROR:
        return part.data
    code = _understood(channel, decode_error, part.data)
    about = f" of 0x{place[0]:04X}:{place[1]:02X}" if place[0] else ""
    raise refused(channel, *place, code, what=f"SDO information{about}")


def _understood(channel: MailboxChannel, decode: Callable[[bytes], T], data: bytes) -> T:
    try:
        return decode(data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: an answer of SDO information that is none: {error}",
            hint="its firmware is at fault; a capture shows the bytes",
        ) from error
