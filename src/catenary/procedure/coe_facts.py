"""Reading of the objects that a comparison with an ESI needs. Nothing is written to an object.

The device must be in PRE-OP. `in_pre_op` brings it there, and back to its state afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias, TypeVar

from catenary.errors import CatenaryError, MailboxError, ResponseTimeout, SdoAbort, StateError
from catenary.model.coe_facts import CoeFacts, EntryFacts, MappedObject
from catenary.model.device import DeviceDescription, Identity
from catenary.procedure.al_state import read_state, request_state
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.pdo import read_list
from catenary.procedure.profile import DEVICE_TYPE, READABLE, WRITABLE
from catenary.procedure.sdo import SMALL_LIMIT, SMALL_TIMEOUT, upload, upload_small
from catenary.procedure.sdo_information import (
    FAILURES_MAX,
    DescribedObject,
    describe_object,
    read_entry_description,
    read_object_description,
    read_object_list,
)
from catenary.procedure.state_path import climb
from catenary.procedure.station import Station
from catenary.wire.al import AlState
from catenary.wire.sdo_information import EntryDescription

T = TypeVar("T")
Progress: TypeAlias = Callable[[int, int], None]  # objects read, objects in total

IDENTITY = 0x1018
ASSIGNMENT_BASE = 0x1C10
PDOS_MAX = 512  # mappings that are read
OBJECTS_MAX = 4096  # objects that are described


class Question(NamedTuple):
    """Objects to read, and capabilities to try."""

    sync_managers: tuple[int, ...] = ()  # with process data
    pdos: tuple[int, ...] = ()
    sdo_information: bool = False  # SII or ESI claim it
    complete_access: bool = False  # SII or ESI claim it
    objects: tuple[int, ...] | None = None  # to describe; None skips the dictionary


def in_pre_op(
    station: Station,
    device: DeviceDescription,
    conversation: Callable[[MailboxChannel], Procedure[T]],
) -> Procedure[T]:
    """Run a conversation with a device in PRE-OP, then restore its state.

    A device in PRE-OP passes through INIT, which restarts its mailbox. A device in another state
    keeps it.

    Args:
        station: The device.
        device: Its description.
        conversation: Function that makes the procedure for the mailbox of the device.

    Raises:
        StateError: The device is in SAFE-OP, OP or BOOT, has an error, or does not reach PRE-OP.
        MailboxError: The device has no mailbox.
    """
    found = yield from read_state(station)
    before = found.state
    if before not in (AlState.INIT, AlState.PRE_OP) or found.error:
        error = " with an error" if found.error else ""
        raise StateError(
            f"{station} is in {found.name}{error}; its state was not changed",
            position=station.position,
            requested=int(AlState.PRE_OP),
            actual=found.word & 0x0F,
            code=found.code,
            hint="end the program that uses it, then bring it to PRE-OP with `catenary state`",
        )
    try:
        if before is AlState.PRE_OP:
            yield from request_state(station, AlState.INIT)
        channel = yield from climb(station, device, AlState.PRE_OP)
        if channel is None:
            raise MailboxError(f"{station} has no mailbox")
        result = yield from conversation(channel)
    except CatenaryError:
        with suppress(CatenaryError):
            yield from request_state(station, before)
        raise
    if before is AlState.INIT:
        yield from request_state(station, before)
    return result


def read_coe_facts(
    channel: MailboxChannel, question: Question, progress: Progress
) -> Procedure[CoeFacts]:
    """Read the objects. Notes name what could not be read.

    Args:
        channel: The mailbox of the device.
        question: Objects to read.
        progress: Function to call with (objects read, objects in total).
    """
    reader = _Reader(channel, progress)
    facts = CoeFacts(
        identity=(yield from reader.identity()),
        device_type=(yield from reader.number(DEVICE_TYPE)),
        assignments=(yield from reader.assignments(question.sync_managers)),
    )
    assigned = [index for each in facts.assignments.values() for index in each or ()]
    pdos = list(dict.fromkeys((*assigned, *question.pdos)))
    facts = replace(facts, mappings=(yield from reader.mappings(pdos)))
    if question.complete_access:
        facts = replace(facts, complete_access=(yield from reader.complete_access()))
    if question.sdo_information:
        facts = yield from reader.information(facts, question)
    return replace(facts, notes=tuple(reader.notes))


@dataclass
class _Reader:
    """Reading of optional objects. It stops after several missing answers in a row."""

    channel: MailboxChannel
    progress: Progress

    def __post_init__(self) -> None:
        self.notes: list[str] = []
        self._failures = 0

    def attempt(self, procedure: Procedure[T], what: str) -> Procedure[T | None]:
        """Run a procedure. Return None if the device refuses or does not answer.

        Args:
            procedure: The procedure to run.
            what: What it reads, for the note about a missing answer.
        """
        if self._failures >= FAILURES_MAX:
            procedure.close()
            return None
        try:
            result = yield from procedure
        except SdoAbort:
            self._failures = 0
            return None
        except (MailboxError, ResponseTimeout) as error:
            self._failures += 1
            reason = error.message.removeprefix(f"{self.channel.station}: ")
            self.notes.append(f"{what} cannot be read: {reason}")
            if self._failures == FAILURES_MAX:
                self.notes.append(f"reading ended after {FAILURES_MAX} failures in a row")
            return None
        self._failures = 0
        return result

    def number(self, index: int, subindex: int = 0) -> Procedure[int | None]:
        place = f"0x{index:04X}:{subindex:02X}"
        data = yield from self.attempt(upload_small(self.channel, index, subindex), place)
        return None if data is None else int.from_bytes(data[:4], "little")

    def identity(self) -> Procedure[Identity | None]:
        numbers = []
        for subindex in range(1, 5):
            numbers.append((yield from self.number(IDENTITY, subindex)))
        vendor, product, revision, serial = numbers
        if vendor is None or product is None or revision is None:
            return None
        return Identity(vendor, product, revision, serial or 0)

    def assignments(
        self, managers: tuple[int, ...]
    ) -> Procedure[dict[int, tuple[int, ...] | None]]:
        found: dict[int, tuple[int, ...] | None] = {}
        for manager in managers:
            index = ASSIGNMENT_BASE + manager
            words = yield from self.attempt(read_list(self.channel, index), f"0x{index:04X}")
            numbers = (int.from_bytes(word[:2], "little") for word in words or ())
            found[manager] = None if words is None else tuple(each for each in numbers if each)
        return found

    def mappings(self, pdos: list[int]) -> Procedure[dict[int, tuple[MappedObject, ...] | None]]:
        found: dict[int, tuple[MappedObject, ...] | None] = {}
        if len(pdos) > PDOS_MAX:
            self.notes.append(f"only {PDOS_MAX} of {len(pdos)} PDOs were read")
        for number, index in enumerate(pdos[:PDOS_MAX], start=1):
            words = yield from self.attempt(read_list(self.channel, index), f"0x{index:04X}")
            found[index] = None if words is None else tuple(_mapped(word) for word in words)
            self.progress(number, min(len(pdos), PDOS_MAX))
        return found

    def complete_access(self) -> Procedure[bool | None]:
        """Try complete access with object 0x1018, which every device with CoE has."""
        procedure = upload(
            self.channel,
            IDENTITY,
            0,
            complete_access=True,
            limit=SMALL_LIMIT,
            timeout=SMALL_TIMEOUT,
        )
        return (yield from self._works(procedure, "0x1018 by complete access"))

    def information(self, facts: CoeFacts, question: Question) -> Procedure[CoeFacts]:
        """Return the facts with descriptions of objects, if the device describes 0x1000."""
        works = yield from self._works(
            read_object_description(self.channel, DEVICE_TYPE), "the description of 0x1000"
        )
        facts = replace(facts, sdo_information=works)
        if not works:
            return facts
        facts = replace(facts, pdo_assign=(yield from self._assignable(question.sync_managers)))
        return facts if question.objects is None else (yield from self._objects(facts, question))

    def _works(self, procedure: Procedure[object], what: str) -> Procedure[bool | None]:
        """Return True if the request succeeds, False if it fails, None if it was not sent."""
        if self._failures >= FAILURES_MAX:
            procedure.close()
            return None
        return (yield from self.attempt(procedure, what)) is not None

    def _assignable(self, managers: tuple[int, ...]) -> Procedure[bool | None]:
        """Return True if an assignment object is writable; None if none of them is described."""
        found = []
        for manager in managers:
            index = ASSIGNMENT_BASE + manager
            procedure = read_entry_description(self.channel, index, 0)
            entry = yield from self.attempt(procedure, f"the description of 0x{index:04X}")
            if entry is not None and entry.access & READABLE:
                found.append(bool(entry.access & WRITABLE))
        return any(found) if found else None

    def _objects(self, facts: CoeFacts, question: Question) -> Procedure[CoeFacts]:
        listed = yield from self.attempt(read_object_list(self.channel), "the list of objects")
        if listed is None:
            return facts
        if listed.note:
            self.notes.append(listed.note)
        present = set(listed.indices)
        wanted = [index for index in question.objects or () if index in present]
        if len(wanted) > OBJECTS_MAX:
            self.notes.append(f"only {OBJECTS_MAX} of {len(wanted)} objects were described")
        objects: dict[int, tuple[EntryFacts, ...] | None] = {}
        for number, index in enumerate(wanted[:OBJECTS_MAX], start=1):
            procedure = describe_object(self.channel, index)
            described = yield from self.attempt(procedure, f"the description of 0x{index:04X}")
            objects[index] = None if described is None else self._entries(described)
            self.progress(number, min(len(wanted), OBJECTS_MAX))
        indices = None if listed.note else frozenset(present)
        return replace(facts, indices=indices, objects=objects)

    def _entries(self, described: DescribedObject) -> tuple[EntryFacts, ...] | None:
        """Return the entries; None if some could not be described."""
        self.notes += described.notes
        return None if described.notes else tuple(_entry(each) for each in described.entries)


def _mapped(word: bytes) -> MappedObject:
    number = int.from_bytes(word[:4], "little")
    return number >> 16, number >> 8 & 0xFF, number & 0xFF


def _entry(entry: EntryDescription) -> EntryFacts:
    return EntryFacts(
        entry.index,
        entry.subindex,
        entry.data_type,
        entry.bit_length,
        bool(entry.access & READABLE),
        bool(entry.access & WRITABLE),
    )
