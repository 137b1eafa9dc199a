"""Reading of a whole object dictionary with values, in PRE-OP. Nothing is written to an object.

What cannot be read does not stop the reading: abort codes and reasons are kept per entry. Missing
answers end it after `FAILURES_MAX` in a row, and so does a deadline for the whole dictionary.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeAlias

from catenary.errors import CatenaryError, MailboxError, ResponseTimeout, SdoAbort, StateError
from catenary.line.values import SERIAL_WITHHELD, ClonedEntry, ClonedObject
from catenary.procedure.clone_access import while_writable
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import OBJECT_MISSING, upload, upload_small
from catenary.procedure.sdo_information import (
    FAILURES_MAX,
    read_entry_description,
    read_object_description,
    read_object_list,
)
from catenary.procedure.station import Deadline
from catenary.wire.al import AlState
from catenary.wire.sdo_information import Access, EntryDescription, ObjectCode

Progress: TypeAlias = Callable[[int, int], None]  # objects read, objects in total

VALUE_LIMIT, VALUE_TIMEOUT = 1 << 16, 20.0  # [bytes], [s] per value; larger ones get a reason
DEVICE_TYPE, IDENTITY, ASSIGNMENT_BASE = 0x1000, 0x1018, 0x1C10
SERIALS = {(IDENTITY, 4), (0xF9F0, 0)}  # ETG.1000.6; manufacturer's serial number, ETG.5001
# Objects of devices that do not list theirs: ETG.1000.6 §5.6.7.4
STANDARD = (
    *(DEVICE_TYPE, 0x1001, 0x1008, 0x1009, 0x100A, IDENTITY, 0x1C00),
    *range(ASSIGNMENT_BASE, ASSIGNMENT_BASE + 0x10),
    *(0x1C32, 0x1C33),
)
FIRST_PDO = 0x1600
LISTS = {IDENTITY, *range(ASSIGNMENT_BASE, ASSIGNMENT_BASE + 0x10), 0x1C00, 0x1C32, 0x1C33}
ANY_READ = Access.READ_PRE_OP | Access.READ_SAFE_OP | Access.READ_OP
ANY_WRITE = Access.WRITE_PRE_OP | Access.WRITE_SAFE_OP | Access.WRITE_OP
_FAILURES = (MailboxError, ResponseTimeout)


class Dictionary(NamedTuple):
    """Objects in the order of their indices, and why some are missing (else empty)."""

    objects: tuple[ClonedObject, ...]
    missing: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Question:
    """Objects and values to read, and the time limit."""

    pdos: tuple[int, ...] = ()  # mappings to read if the device does not list its objects
    serials: bool = True  # False leaves serial numbers out
    timeout: float = 600.0  # [s]


class _Ended(Exception):
    """Reading ends here, for a reason."""


def read_dictionary(
    channel: MailboxChannel, question: Question, progress: Progress
) -> Procedure[Dictionary]:
    """Read all objects of a device with their values.

    Args:
        channel: The mailbox of the device.
        question: What to read.
        progress: Function to call with (objects read, objects in total).

    Raises:
        CatenaryError: The device does not answer at all, or cannot be asked.
    """
    reader = _Reader(channel, question, progress)
    in_pre_op = partial(while_writable, channel.station)
    yield from in_pre_op(_first_answer(channel), AlState.PRE_OP)
    try:
        yield from in_pre_op(reader.all_objects(), AlState.PRE_OP)
    except _Ended as end:
        reader.missing.append(str(end))
    except StateError as error:
        reader.missing.append(f"reading ended: {reader.reason(error)}")
    objects = tuple(sorted(reader.objects.values(), key=lambda each: each.index))
    return Dictionary(objects, "; ".join(reader.missing), tuple(reader.notes))


def _first_answer(channel: MailboxChannel) -> Procedure[None]:
    """Read 0x1000. Try twice, because the counter of an earlier master is unknown.

    A device ignores a message with the counter of the last one (ETG.1000.4 §5.6). The second
    attempt has another counter.
    """
    for last in (False, True):
        try:
            yield from upload_small(channel, DEVICE_TYPE, 0)
        except SdoAbort:
            return
        except ResponseTimeout:
            if last:
                raise
        else:
            return


class _Reader:
    """Reading of one dictionary. It owns the objects read so far."""

    def __init__(self, channel: MailboxChannel, question: Question, progress: Progress) -> None:
        self.objects: dict[int, ClonedObject] = {}
        self.missing: list[str] = []
        self.notes: list[str] = []
        self._channel = channel
        self._question = question
        self._progress = progress
        self._deadline = Deadline(question.timeout)
        self._failures = 0
        self._done = self._total = 0

    def all_objects(self) -> Procedure[None]:
        """Read the listed objects; without a list, those of the standard."""
        indices = yield from self._listed()
        listed = bool(indices)
        wanted = list(indices or dict.fromkeys((*STANDARD, *self._question.pdos)))
        while self._done < len(wanted):
            self._total = len(wanted)
            index = wanted[self._done]
            self._continue()
            yield from self._described(index) if listed else self._undescribed(index)
            if not listed and index in self.objects:
                wanted += [pdo for pdo in self._assigned(index) if pdo not in wanted]
            self._done += 1
            self._progress(self._done, len(wanted))

    def _listed(self) -> Procedure[Sequence[int]]:
        """Return the indices that the device lists; none if it does not support the service."""
        try:
            indices, note = yield from read_object_list(self._channel)
        except SdoAbort as error:
            self.notes.append(f"the device does not list its objects: {self.reason(error)}")
            return ()
        except _FAILURES as error:
            reason = self.reason(error)
            if self._channel.layout.sdo_information:
                self.missing.append(f"the list of objects cannot be read: {reason}")
            else:
                self.notes.append(f"the device does not list its objects: {reason}")
            return ()
        if note:
            self.missing.append(note)
        return sorted(set(indices))

    def _assigned(self, index: int) -> Sequence[int]:
        """Return the PDOs in an assignment object (0x1C10 to 0x1C1F) that was read."""
        if not ASSIGNMENT_BASE <= index < ASSIGNMENT_BASE + 0x10:
            return ()
        values = [entry.value or b"" for entry in self.objects[index].entries if entry.subindex]
        return [int.from_bytes(value[:2], "little") for value in values if any(value[:2])]

    def _continue(self) -> None:
        """Raise _Ended if the reading must not continue."""
        progress = f"{self._done} of {self._total} objects were read"
        if self._deadline.passed_at(self._channel.received_ns):
            raise _Ended(f"reading ended after {self._question.timeout:g} s: {progress}")
        if self._failures >= FAILURES_MAX:
            raise _Ended(f"reading ended after {FAILURES_MAX} failures in a row: {progress}")

    def _described(self, index: int) -> Procedure[None]:
        try:
            found = yield from read_object_description(self._channel, index)
        except (SdoAbort, *_FAILURES) as error:
            self._count(error)
            reason = self.reason(error)
            self.objects[index] = ClonedObject(index, 0, 0, 0, reason=reason)
            yield from self._undescribed(index, reason)
            return
        self._failures = 0
        last = 0 if found.object_code == ObjectCode.VAR else found.maximum_subindex
        entries: list[ClonedEntry] = []
        reasons: list[str] = []
        for subindex in range(last + 1):
            self._continue()
            entry = yield from self._entry(index, subindex, reasons)
            entries += [] if entry is None else [entry]
            self.objects[index] = ClonedObject(
                *(index, found.object_code, found.data_type, found.maximum_subindex, found.name),
                tuple(entries),
                "; ".join(reasons),
            )

    def _entry(
        self, index: int, subindex: int, reasons: list[str]
    ) -> Procedure[ClonedEntry | None]:
        """Read one described entry; None if it does not exist."""
        try:
            found = yield from read_entry_description(self._channel, index, subindex)
        except SdoAbort as error:
            self._failures = 0
            if error.code not in OBJECT_MISSING:
                reasons.append(f"0x{subindex:02X} is not described: {self.reason(error)}")
            return None
        except _FAILURES as error:
            self._count(error)
            reasons.append(f"0x{subindex:02X} is not described: {self.reason(error)}")
            return None
        self._failures = 0
        return (yield from self._with_value(_cloned(found)))

    def _undescribed(self, index: int, reason: str = "") -> Procedure[None]:
        """Read the values of an object that the device does not describe. Omit an absent one."""
        count = yield from self._with_value(_plain(index, 0))
        if count.value is None and (reason or count.abort in OBJECT_MISSING):
            return
        entries = [count]
        last = count.value[0] if count.value and _is_list(index) else 0
        for subindex in range(1, last + 1):
            self._continue()
            entries.append((yield from self._with_value(_plain(index, subindex))))
        self.objects[index] = ClonedObject(index, 0, 0, last, "", tuple(entries), reason)

    def _with_value(self, entry: ClonedEntry) -> Procedure[ClonedEntry]:
        """Return an entry with its value, or the reason for its absence."""
        place = (entry.index, entry.subindex)
        if place in SERIALS and not self._question.serials:
            return replace(entry, reason=SERIAL_WITHHELD)
        if entry.access & (ANY_READ | ANY_WRITE) and not entry.access & Access.READ_PRE_OP:
            return entry
        try:
            value = yield from upload(
                self._channel, *place, limit=VALUE_LIMIT, timeout=VALUE_TIMEOUT
            )
        except SdoAbort as error:
            self._failures = 0
            return replace(entry, abort=error.code)
        except _FAILURES as error:
            self._count(error)
            return replace(entry, reason=self.reason(error))
        self._failures = 0
        return replace(entry, value=value)

    def _count(self, error: CatenaryError) -> None:
        """Count a missing answer. A refusal is an answer."""
        self._failures = 0 if isinstance(error, SdoAbort) else self._failures + 1

    def reason(self, error: CatenaryError) -> str:
        """Return the message of an error without the device."""
        return error.message.removeprefix(f"{self._channel.station}").lstrip(": ")


def _cloned(found: EntryDescription) -> ClonedEntry:
    name = ""
    with suppress(ValueError):
        name = found.name
    return ClonedEntry(
        *(found.index, found.subindex, found.data_type, found.bit_length, found.access), name
    )


def _plain(index: int, subindex: int) -> ClonedEntry:
    return ClonedEntry(index, subindex, 0, 0, Access(0))


def _is_list(index: int) -> bool:
    """Return True if subindex 0 of an object of the standard is the number of its entries."""
    return index in LISTS or FIRST_PDO <= index < ASSIGNMENT_BASE
