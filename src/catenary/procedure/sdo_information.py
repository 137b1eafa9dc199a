"""SDO information services, ETG.1000.6 §5.6.3: the objects of a device and their descriptions.

An answer may consist of fragments, one mailbox message each. The device sends them without further
requests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from catenary.errors import CatenaryError, DecodeError, MailboxError, ResponseTimeout, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively, further
from catenary.procedure.sdo import OBJECT_MISSING, decoded, refused
from catenary.procedure.station import Deadline
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
ANSWER_MAX = 2 + 2 * 0x1_0000  # bytes: a list of all possible indices
ANSWER_TIMEOUT = 20.0  # [s] for all fragments of one answer
FAILURES_MAX = 3  # missing or malformed answers in a row before requests end
PLACES_SHOWN = 8  # number of places that a note lists per reason
FAILURES = (SdoAbort, MailboxError, ResponseTimeout)


class ObjectIndices(NamedTuple):
    """The indices of a list. `note` reports its faults; it is empty if the list is complete."""

    indices: tuple[int, ...]
    note: str = ""


class ObjectDescriptions(NamedTuple):
    """The objects of a list, and notes about those that could not be described."""

    objects: tuple[ObjectDescription, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DescribedObject:
    """An object and its entries, by subindex. A variable has one entry.

    `notes` explains missing entries.
    """

    description: ObjectDescription
    entries: tuple[EntryDescription, ...]
    notes: tuple[str, ...] = ()

    @property
    def index(self) -> int:
        """Index of the object."""
        return self.description.index

    @property
    def name(self) -> str:
        """Name of the object."""
        return self.description.name


def read_object_list(
    channel: MailboxChannel, kind: ListType = ListType.ALL
) -> Procedure[ObjectIndices]:
    """Read the indices of the objects of a kind.

    If the list was truncated, the result contains the received part and a note.

    Args:
        channel: The mailbox of the device.
        kind: The kind of list.

    Raises:
        SdoAbort: The device refuses the request.
        MailboxError: The answer is invalid.
    """
    data, cut = yield from _ask(channel, list_request(kind), Opcode.LIST_RESPONSE, (0, 0))
    indices = _understood(channel, decode_object_list, data).indices
    if cut or len(data) % 2:
        reason = cut or f"{len(data)} bytes are not a whole number of indices"
        return ObjectIndices(indices, f"the list of objects is truncated: {reason}")
    if kind is ListType.ALL:
        count = yield from _count_objects(channel)
        if count > len(indices):
            note = f"the list of objects is truncated: it contains {len(indices)} of {count}"
            return ObjectIndices(indices, note)
    return ObjectIndices(indices)


def read_object_description(channel: MailboxChannel, index: int) -> Procedure[ObjectDescription]:
    """Read the description of an object.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.

    Raises:
        SdoAbort: The device refuses the request.
        MailboxError: The answer is invalid.
    """
    data, _ = yield from _ask(channel, object_request(index), Opcode.OBJECT_RESPONSE, (index, 0))
    return _understood(channel, decode_object_description, data)


def read_entry_description(
    channel: MailboxChannel, index: int, subindex: int, info: ValueInfo = ValueInfo.NONE
) -> Procedure[EntryDescription]:
    """Read the description of an entry.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.
        info: Optional fields to read.

    Raises:
        SdoAbort: The device refuses the request.
        MailboxError: The answer is invalid.
    """
    request = entry_request(index, subindex, info)
    data, _ = yield from _ask(channel, request, Opcode.ENTRY_RESPONSE, (index, subindex))
    return _understood(channel, decode_entry_description, data)


def describe_object(channel: MailboxChannel, index: int) -> Procedure[DescribedObject]:
    """Read the descriptions of an object and of its entries.

    Subindices that do not exist are omitted, because arrays may have gaps. Other subindices that
    the device does not describe are omitted with a note, as in IgH (fsm_coe.c,
    dict_entry_response).

    Args:
        channel: The mailbox of the device.
        index: The index of the object.

    Raises:
        SdoAbort: The device refuses to describe the object.
        MailboxError: The description of the object is invalid.
    """
    description = yield from read_object_description(channel, index)
    single = description.object_code == ObjectCode.VAR
    last = 0 if single else description.maximum_subindex
    entries = []
    failures = _Failures(channel)
    for subindex in range(last + 1):
        try:
            entries.append((yield from read_entry_description(channel, index, subindex)))
            failures.forget()
        except FAILURES as error:
            if not _is_absent(error):
                failures.add(f"0x{index:04X}:{subindex:02X}", error)
        if failures.are_too_many:
            break
    return DescribedObject(description, tuple(entries), failures.notes)


def describe_entry(
    channel: MailboxChannel, index: int, subindex: int
) -> Procedure[tuple[EntryDescription | None, str]]:
    """Read the optional description of an entry.

    After `FAILURES_MAX` missing or malformed answers in a row, no further request is sent.

    Args:
        channel: The mailbox of the device.
        index: The index of the object.
        subindex: The subindex of the entry.

    Returns:
        The description, and a note. The description is None if the device does not describe the
        entry. The note is empty unless the answer was missing or malformed.
    """
    if channel.undescribed >= FAILURES_MAX:
        return None, ""
    try:
        entry = yield from read_entry_description(channel, index, subindex)
    except SdoAbort:
        return None, ""
    except (MailboxError, ResponseTimeout) as error:
        channel.undescribed += 1
        reason = error.message.removeprefix(f"{channel.station}: ")
        return None, f"0x{index:04X}:{subindex:02X} cannot be described: {reason}"
    channel.undescribed = 0
    return entry, ""


def list_objects(
    channel: MailboxChannel, kind: ListType = ListType.ALL
) -> Procedure[ObjectDescriptions]:
    """Read the descriptions of all objects of a kind.

    Listed objects that do not exist are omitted. Other objects that the device does not describe
    have object code 0. Notes report both cases.

    Args:
        channel: The mailbox of the device.
        kind: The kind of list.

    Raises:
        SdoAbort: The device refuses to list its objects.
        MailboxError: The list is invalid.
    """
    indices, note = yield from read_object_list(channel, kind)
    found: list[ObjectDescription] = []
    failures = _Failures(channel, note)
    for index in indices:
        undescribed = ObjectDescription(index, 0, 0, 0)
        if failures.are_too_many:
            found.append(undescribed)
            continue
        try:
            found.append((yield from read_object_description(channel, index)))
            failures.forget()
        except FAILURES as error:
            failures.add(f"0x{index:04X}", error)
            found += [] if _is_absent(error) else [undescribed]
    return ObjectDescriptions(tuple(found), failures.notes)


class _Failures:
    """Places that the device did not describe, by reason."""

    def __init__(self, channel: MailboxChannel, note: str = "") -> None:
        self._first = (note,) if note else ()
        self._prefix = f"{channel.station}: "
        self._places: dict[str, list[str]] = {}
        self._in_a_row = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """One note per reason."""
        found = (
            f"{_enumerated(places)} cannot be described: {reason}"
            for reason, places in self._places.items()
        )
        stopped = f"requests ended after {FAILURES_MAX} failures in a row"
        return (*self._first, *found, *((stopped,) if self.are_too_many else ()))

    @property
    def are_too_many(self) -> bool:
        """True if no further request should be sent, because each one may take seconds."""
        return self._in_a_row >= FAILURES_MAX

    def forget(self) -> None:
        """Reset the count of failures after a valid answer."""
        self._in_a_row = 0

    def add(self, place: str, error: CatenaryError) -> None:
        """Add a failure at a place. A refusal is an answer and resets the count of failures."""
        refusal = isinstance(error, SdoAbort)
        reason = error.message.removeprefix(self._prefix)
        reason = "refused " + reason.partition(" refused ")[2] if refusal else reason
        self._places.setdefault(reason, []).append(place)
        self._in_a_row = 0 if refusal else self._in_a_row + 1


def _enumerated(places: list[str]) -> str:
    more = f" and {len(places) - PLACES_SHOWN} more" if len(places) > PLACES_SHOWN else ""
    return ", ".join(places[:PLACES_SHOWN]) + more


def _is_absent(error: CatenaryError) -> bool:
    return isinstance(error, SdoAbort) and error.code in OBJECT_MISSING


def _count_objects(channel: MailboxChannel) -> Procedure[int]:
    """Return the number of objects that the device reports; 0 if it does not report a number.

    KickCAT (lib/src/CoE/mailbox/response.cc, fillList) computes the number of fragments from the
    mailbox size and ignores the headers. The end of a list may therefore be missing without notice.
    """
    request = list_request(ListType.LENGTHS)
    try:
        data, _ = yield from _ask(channel, request, Opcode.LIST_RESPONSE, (0, 0))
        return next(iter(_understood(channel, decode_object_list, data).indices), 0)
    except FAILURES:
        return 0  # the number is optional: the list itself was received


def _ask(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[tuple[bytes, str]]:
    return exclusively(channel, _exchange(channel, request, expected, place))


def _exchange(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[tuple[bytes, str]]:
    """Return the joined data of all fragments, and the reason if some are missing (else empty)."""

    def accept_part(mailbox: Mailbox) -> SdoInformation | None:
        message = decoded(channel, mailbox)
        if not isinstance(message, SdoInformation):
            return None
        return message if message.opcode in (expected, Opcode.ERROR) else None

    def accept_first(mailbox: Mailbox) -> SdoInformation | None:
        # Every answer repeats the list type, the index, or the index and subindex of the request.
        part, about = accept_part(mailbox), request.data[: ABOUT[expected]]
        late = part and part.opcode is expected and not part.data.startswith(about)
        return None if late else part

    part: SdoInformation = yield from converse(channel, Type.COE, request.encode(), accept_first)
    data = bytearray(_content(channel, part, place))
    deadline = Deadline(ANSWER_TIMEOUT)
    while _is_continued(part):
        try:
            part = yield from further(channel, accept_part)
            content = _content(channel, part, place)
        except FAILURES as error:
            return bytes(data), error.message.removeprefix(f"{channel.station}: ")
        if deadline.passed_at(channel.received_ns):
            return bytes(data), f"it was not complete after {ANSWER_TIMEOUT:g} s"
        if not content or len(data) + len(content) > ANSWER_MAX:
            return bytes(data), "its fragments do not end"
        data += content
    return bytes(data), ""


def _is_continued(part: SdoInformation) -> bool:
    """Return True if fragments follow. For a list, check both fields, as in IgH (fsm_coe.c)."""
    return part.incomplete or (part.opcode is Opcode.LIST_RESPONSE and part.fragments_left > 0)


def _content(channel: MailboxChannel, part: SdoInformation, place: tuple[int, int]) -> bytes:
    if part.opcode is not Opcode.ERROR:
        return part.data
    code = decode_error(part.data)
    about = f" of 0x{place[0]:04X}:{place[1]:02X}" if place[0] else ""
    raise refused(channel, *place, code, what=f"SDO information{about}")


def _understood(channel: MailboxChannel, decode: Callable[[bytes], T], data: bytes) -> T:
    try:
        return decode(data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: invalid SDO information answer: {error}",
            hint="its firmware is at fault; record a capture to see the bytes",
        ) from error
