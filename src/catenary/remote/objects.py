"""Methods about object dictionaries: list, read and write objects."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import msgspec

from catenary.bus import SubDevice
from catenary.bus.esi_objects import describe_esi_object, list_esi_objects
from catenary.errors import DecodeError, LoopError
from catenary.model.process_data import ObjectInformation, mapped_entries
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.sdo import download, upload
from catenary.procedure.sdo_information import (
    FAILURES,
    DescribedObject,
    describe_entry,
    describe_object,
    read_object_list,
)
from catenary.remote import messages
from catenary.remote.program import Program, Work, checked
from catenary.types import DataType, Integer, Value, by_index, by_name
from catenary.wire.sdo_information import Access, EntryDescription, ListType, ObjectCode

PAGE_TIME = 2.0  # [s] after which a page ends
PAGE_SIZE = 24 * 1024  # [bytes] after which a page ends; an object has at most as many again
PAGE_MAX = 500  # entries
OPTIONS_MAX = 64  # values with texts of an entry
CONTROLWORD, MODE, SLOT = 0x6040, 0x6060, 0x0800
FIRST_AXIS, LAST_AXIS = 0x6000, 0x9FFF  # objects of the axes
MAPPING = ((0x1600, 0x17FF), (0x1A00, 0x1BFF), (0x1C10, 0x1C2F))
STATES = "PSO"  # PRE-OP, SAFE-OP, OP: bits 0 to 2 for reading, 3 to 5 for writing


def objects(
    program: Program, position: int, after: int | None = None, count: int = 200
) -> Work[messages.Objects]:
    """Read a page of the object dictionary of a device; see `Client.objects`."""
    if not 1 <= count <= PAGE_MAX:
        raise ValueError(f"count={count}: must be 1 to {PAGE_MAX}")
    channel, sub = program.channel(position), program.device(position)
    indices, notes = yield from _indices(program, sub, channel)
    notes = list(notes) if after is None else []
    entries: list[messages.ObjectEntry] = []
    size, end = 0, time.monotonic() + PAGE_TIME
    for index in indices:
        if after is not None and index <= after:
            continue
        try:
            described = yield from _described(program, sub, channel, index)
        except FAILURES as error:
            notes.append(error.message)
        else:
            program.types |= {
                (sub.identity, each.index, each.subindex): each.data_type
                for each in described.entries
            }
            entries += (found := _entries(sub, described))
            notes += described.notes
            size += len(msgspec.msgpack.encode(found))
        if index != indices[-1] and (
            len(entries) >= count or size > PAGE_SIZE or time.monotonic() > end
        ):
            return messages.Objects(entries=entries, next=index, notes=notes)
        yield None
    return messages.Objects(entries=entries, next=None, notes=notes)


def _indices(
    program: Program, sub: SubDevice, channel: MailboxChannel
) -> Work[tuple[tuple[int, ...], list[str]]]:
    """Return the indices of a dictionary, and notes. Each dictionary is listed once."""
    key = (sub.position, sub.identity)
    if key not in program.dictionaries:
        if sub.esi is not None and not channel.layout.sdo_information:
            known = tuple(each.index for each in list_esi_objects(sub.esi, ListType.ALL))
            note = f"{sub.station} has no SDO information: objects of {sub.esi.source}"
            program.dictionaries[key] = known, [note]
        else:
            found = yield from program.ask(read_object_list(channel))
            notes = [found.note] if found.note else []
            program.dictionaries[key] = tuple(sorted(found.indices)), notes
    return program.dictionaries[key]


def _described(
    program: Program, sub: SubDevice, channel: MailboxChannel, index: int
) -> Work[DescribedObject]:
    if sub.esi is not None and not channel.layout.sdo_information:
        known = describe_esi_object(sub.esi, index)
        if known is not None:
            return known
    return (yield from program.ask(describe_object(channel, index)))


def _entries(sub: SubDevice, described: DescribedObject) -> list[messages.ObjectEntry]:
    single = described.description.object_code == ObjectCode.VAR
    return [
        _entry(sub, described.name, described.name if single and not each.name else each.name, each)
        for each in described.entries
    ]


def _entry(
    sub: SubDevice, object_name: str, name: str, entry: EntryDescription
) -> messages.ObjectEntry:
    known = sub.description.documented_object(entry.index, entry.subindex)
    kind = _base_type(entry.data_type)
    return messages.ObjectEntry(
        index=entry.index,
        subindex=entry.subindex,
        object_name=object_name,
        name=name,
        type=kind.name if kind is not None else f"0x{entry.data_type:04X}",
        bits=entry.bit_length,
        access=access_text(entry.access),
        unit=known.unit if known is not None else "",
        options=_options(known),
        minimum=kind.minimum if isinstance(kind, Integer) else None,
        maximum=kind.maximum if isinstance(kind, Integer) else None,
    )


def access_text(access: Access) -> str:
    """Return "r", "w" or "rw", and the states if the access is limited to some: "rw P"."""
    allowed = {letter: access >> shift & 0b111 for letter, shift in (("r", 0), ("w", 3))}
    letters = "".join(letter for letter, states in allowed.items() if states)
    limited = [states for states in allowed.values() if states not in (0, 0b111)]
    if not limited:
        return letters
    where = "".join(STATES[bit] for bit in range(3) if limited[-1] >> bit & 1)
    return f"{letters} {where}"


def sdo_read(
    program: Program, position: int, index: int, subindex: int = 0, type: str | None = None
) -> Work[messages.SdoValue]:
    """Read an object; see `Client.sdo_read`."""
    _check_place(index, subindex)
    channel, sub = program.channel(position), program.device(position)
    known = sub.description.documented_object(index, subindex)
    kind = yield from _type_of(program, sub, channel, (index, subindex), type)
    data = yield from program.ask(upload(channel, index, subindex))
    try:
        value = None if kind is None else kind.decode(data)
    except DecodeError:
        if type is not None:
            raise
        value, kind = None, None  # the description of the device is wrong
    return _answer(data, value, kind, known)


def sdo_write(
    program: Program,
    position: int,
    index: int,
    value: Any,
    subindex: int = 0,
    type: str | None = None,
) -> Work[messages.SdoValue]:
    """Write an object; see `Client.sdo_write`."""
    _check_place(index, subindex)
    channel, sub = program.channel(position), program.device(position)
    known = sub.description.documented_object(index, subindex)
    kind = yield from _type_of(program, sub, channel, (index, subindex), type)
    data = _encoded(value, kind)
    refuse = partial(_refuse_in_use, program, sub, index, subindex)
    refuse()
    yield from program.ask(checked(refuse, download(channel, index, subindex, data)))
    return _answer(data, None if kind is None else kind.decode(data), kind, known)


def _encoded(value: Any, kind: DataType[Value] | None) -> bytes:
    """Return the bytes of a value.

    Raises:
        ValueError: The type is missing, or the value does not fit.
        TypeError: The value has the wrong type.
    """
    if isinstance(value, bytes):
        return value
    if kind is None:
        raise ValueError("the type of the object is unknown: give type='UDINT', or bytes")
    return kind.encode(kind.parse(value) if isinstance(value, str) else value)


def _refuse_in_use(program: Program, sub: SubDevice, index: int, subindex: int) -> None:
    """Raise LoopError for an object that controls an enabled axis or its process data."""
    enabled = program.powered_axes(sub.position)
    if not enabled or not _is_in_use(sub, index, subindex):
        return
    raise LoopError(
        f"the write to 0x{index:04X}:{subindex:02X} of {sub.station} is refused: it controls "
        f"process data of {', '.join(enabled)}, which is enabled",
        hint="disable the axis first",
    )


def _is_in_use(sub: SubDevice, index: int, subindex: int) -> bool:
    if any(first <= index <= last for first, last in MAPPING):
        return True
    if FIRST_AXIS <= index <= LAST_AXIS and index % SLOT in (CONTROLWORD % SLOT, MODE % SLOT):
        return True
    description = sub.description
    mapped = mapped_entries((*description.outputs, *description.inputs))
    return any((each.index, each.subindex) == (index, subindex) for each in mapped)


def _answer(
    data: bytes, value: Value | None, kind: DataType[Value] | None, known: ObjectInformation | None
) -> messages.SdoValue:
    return messages.SdoValue(
        data=data,
        value=value,
        type=kind.name if kind is not None else "",
        text=_text(data, value, known),
    )


def _text(data: bytes, value: Value | None, known: ObjectInformation | None) -> str:
    if value is None:
        return data.hex(" ")
    text = value.hex(" ") if isinstance(value, bytes) else str(value)
    if known is None:
        return text
    meaning = dict(known.enumeration).get(value) if isinstance(value, int) else None
    return f"{text} {known.unit}".rstrip() + (f" ({meaning})" if meaning else "")


def _options(known: ObjectInformation | None) -> dict[str, str]:
    if known is None:
        return {}
    return {str(value): text for value, text in known.enumeration[:OPTIONS_MAX]}


def _type_of(
    program: Program,
    sub: SubDevice,
    channel: MailboxChannel,
    place: tuple[int, int],
    name: str | None,
) -> Work[DataType[Value] | None]:
    """Return the type with a name, or that of an entry as the device or its ESI describes it."""
    if name is not None:
        return by_name(name)
    known = sub.description.documented_object(*place)
    if known is not None and known.data_type:
        return _base_type(known.data_type)
    key = (sub.identity, *place)
    if key not in program.types and channel.layout.sdo_information:
        entry, _ = yield from program.ask(describe_entry(channel, *place))
        program.types[key] = 0 if entry is None else entry.data_type
    return _base_type(program.types.get(key, 0))


def _base_type(data_type: int) -> DataType[Value] | None:
    try:
        return by_index(data_type)
    except ValueError:
        return None


def _check_place(index: int, subindex: int) -> None:
    if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
        raise ValueError(f"object 0x{index:X}:{subindex:X}: an index has 16 bits, a subindex 8")
