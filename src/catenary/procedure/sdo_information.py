"""SDO information services, ETG.1000.6 §5.6.3: which objects a device has, and what they are.

An answer may come in fragments, one mailbox message each, without being asked for again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from catenary.errors import CatenaryError, DecodeError, MailboxError, ResponseTimeout, SdoAbort
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively, further
from catenary.procedure.sdo import NOT_THERE, decoded, refused
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
ANSWER_MAX = 2 + 2 * 0x1_0000  # bytes: the list of all indices there can be
ANSWER_TIMEOUT = 20.0  # [s] for all fragments of one answer
FAILURES_MAX = 3  # answers in a row that are missing or malformed; then nothing more is asked
PLACES_SHOWN = 8  # of each reason
FAILURES = (SdoAbort, MailboxError, ResponseTimeout)


class ObjectIndices(NamedTuple):
    """The indices of a list, and what is wrong with it; an empty note: nothing."""

    indices: tuple[int, ...]
    note: str = ""


class ObjectDescriptions(NamedTuple):
    """The objects of a list, and notes about those that could not be described."""

    objects: tuple[ObjectDescription, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DescribedObject:
    """An object and its entries, by subindex; a variable has one. `notes`: what is missing."""

    description: ObjectDescription
    entries: tuple[EntryDescription, ...]
    notes: tuple[str, ...] = ()

    @property
    def index(self) -> int:
        return self.description.index

    @property
    def name(self) -> str:
        return self.description.name


def read_object_list(
    channel: MailboxChannel, kind: ListType = ListType.ALL
) -> Procedure[ObjectIndices]:
    """Read the indices of the objects of a kind; what arrived of a list that was cut short.

    Raises:
        SdoAbort: The device refuses.
    """
    data, cut = yield from _ask(channel, list_request(kind), Opcode.LIST_RESPONSE, (0, 0))
    indices = _understood(channel, decode_object_list, data).indices
    if cut or len(data) % 2:
        reason = cut or f"{len(data)} bytes are not whole indices"
        return ObjectIndices(indices, f"the list of objects was cut short: {reason}")
    if kind is ListType.ALL:
        count = yield from _count_objects(channel)
        if count > len(indices):
            note = f"the list of objects was cut short: {len(indices)} of {count} are in it"
            return ObjectIndices(indices, note)
    return ObjectIndices(indices)


def read_object_description(channel: MailboxChannel, index: int) -> Procedure[ObjectDescription]:
    """Read the description of an object. SdoAbort if the device refuses."""
    data, _ = yield from _ask(channel, object_request(index), Opcode.OBJECT_RESPONSE, (index, 0))
    return _understood(channel, decode_object_description, data)


def read_entry_description(
    channel: MailboxChannel, index: int, subindex: int, info: ValueInfo = ValueInfo.NONE
) -> Procedure[EntryDescription]:
    """Read the description of an entry. SdoAbort if the device refuses."""
    request = entry_request(index, subindex, info)
    data, _ = yield from _ask(channel, request, Opcode.ENTRY_RESPONSE, (index, subindex))
    return _understood(channel, decode_entry_description, data)


def describe_object(channel: MailboxChannel, index: int) -> Procedure[DescribedObject]:
    """Read the descriptions of an object and of its entries.

    Subindices that do not exist are left out, because arrays may have gaps; others that the device
    does not describe are left out with a note, as in IgH (fsm_coe.c, dict_entry_response).
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
    """Read the description of an entry where it is useful, not necessary.

    Returns:
        The description, None if the device does not describe the entry; and a note if its answer
        was missing or malformed. After some of these the device is not asked again.
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

    Those that do not exist although they are listed are left out. Of others that the device does
    not describe, the index is known; their object code is 0. Both have a note.
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
    """Owns the places that the device did not describe, by the reason."""

    def __init__(self, channel: MailboxChannel, note: str = "") -> None:
        self._first = (note,) if note else ()
        self._prefix = f"{channel.station}: "
        self._places: dict[str, list[str]] = {}
        self._in_a_row = 0

    @property
    def notes(self) -> tuple[str, ...]:
        found = (
            f"{_enumerated(places)} cannot be described: {reason}"
            for reason, places in self._places.items()
        )
        stopped = f"nothing more was asked after {FAILURES_MAX} failures in a row"
        return (*self._first, *found, *((stopped,) if self.are_too_many else ()))

    @property
    def are_too_many(self) -> bool:
        """True if the device should not be asked again: each further question may take seconds."""
        return self._in_a_row >= FAILURES_MAX

    def forget(self) -> None:
        """A good answer came."""
        self._in_a_row = 0

    def add(self, place: str, error: CatenaryError) -> None:
        refusal = isinstance(error, SdoAbort)
        reason = error.message.removeprefix(self._prefix)
        reason = "refused " + reason.partition(" refused ")[2] if refusal else reason
        self._places.setdefault(reason, []).append(place)
        self._in_a_row = 0 if refusal else self._in_a_row + 1


def _enumerated(places: list[str]) -> str:
    more = f" and {len(places) - PLACES_SHOWN} more" if len(places) > PLACES_SHOWN else ""
    return ", ".join(places[:PLACES_SHOWN]) + more


def _is_absent(error: CatenaryError) -> bool:
    return isinstance(error, SdoAbort) and error.code in NOT_THERE


def _count_objects(channel: MailboxChannel) -> Procedure[int]:
    """Return the number of objects as the device counts them; 0 if it does not say.

    KickCAT (lib/src/CoE/mailbox/response.cc, fillList) computes the number of fragments from the
    mailbox size without its headers, and so leaves out the end of a list, without a mark.
    """
    request = list_request(ListType.LENGTHS)
    try:
        data, _ = yield from _ask(channel, request, Opcode.LIST_RESPONSE, (0, 0))
        return next(iter(_understood(channel, decode_object_list, data).indices), 0)
    except FAILURES:
        return 0  # optional: the list itself is there


def _ask(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[tuple[bytes, str]]:
    return exclusively(channel, _exchange(channel, request, expected, place))


def _exchange(
    channel: MailboxChannel, request: SdoInformation, expected: Opcode, place: tuple[int, int]
) -> Procedure[tuple[bytes, str]]:
    """Return the joined data of all fragments, and why the last ones are missing (empty: none)."""

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
    deadline = Deadline(ANSWER_TIMEOUT)
    while _is_continued(part):
        try:
            part = yield from further(channel, accept_part)
            content = _content(channel, part, place)
        except FAILURES as error:
            return bytes(data), error.message.removeprefix(f"{channel.station}: ")
        if deadline.passed_at(channel.received_ns):
            return bytes(data), f"more fragments follow after {ANSWER_TIMEOUT:g} s"
        if not content or len(data) + len(content) > ANSWER_MAX:
            return bytes(data), "its fragments have no end"
        data += content
    return bytes(data), ""


def _is_continued(part: SdoInformation) -> bool:
    """Return True if fragments follow. For a list both fields count, as in IgH (fsm_coe.c)."""
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
            f"{channel.station}: an answer of SDO information that is none: {error}",
            hint="its firmware is at fault; a capture shows the bytes",
        ) from error
