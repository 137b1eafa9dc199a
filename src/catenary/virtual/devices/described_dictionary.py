"""Dictionary of a described device: the objects of its file, next to those that it always has.

The virtual device always has the objects of the communication profile and those of its PDOs,
because they are part of its behaviour. If the file lists the objects of a real device, these
objects get the names and rights of the file. Objects that the file does not list are removed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from catenary.virtual.coe.dictionary import RECORD, VARIABLE, Abort, Entry, Object
from catenary.virtual.coe.object_facts import ObjectFacts
from catenary.virtual.devices.application import Application

TEXTS = (0x1008, 0x1009, 0x100A)  # name and versions
ERROR_REGISTER = 0x1001


def add_described(
    application: Application,
    objects: Mapping[int, tuple[ObjectFacts, dict[int, Entry]]],
    *,
    exact: bool,
) -> None:
    """Add the objects of a file to the dictionary of a device.

    Args:
        application: Application of the device.
        objects: Facts and entries of the objects, by index.
        exact: True if these are all objects of a real device.
    """
    dictionary = application.dictionary
    own = set(dictionary.objects)
    if not exact:
        own -= {index for index in TEXTS if index in objects and _has_value(objects[index][0])}
    live = {*application.pdos.indices, ERROR_REGISTER} & own if exact else own
    for index, (facts, entries) in objects.items():
        if index in live and not exact:
            continue
        if index in live:
            entries = _dressed(facts, entries, dictionary.objects[index].entries)
        if exact:
            dictionary.objects[index] = _as_recorded(facts, entries)
        else:
            code = VARIABLE if set(entries) == {0} else RECORD
            dictionary.add(index, facts.name, entries, code=code)
    if exact and objects:
        for index in own - set(objects):
            del dictionary.objects[index]


def _as_recorded(facts: ObjectFacts, entries: dict[int, Entry]) -> Object:
    """Return an object with the description of the file; code 0 means that there is none."""
    code = facts.code or (VARIABLE if set(entries) == {0} else RECORD)
    return Object(
        facts.index,
        facts.name,
        code,
        facts.data_type,
        entries,
        maximum=facts.maximum,
        described=bool(facts.code),
    )


def _has_value(facts: ObjectFacts) -> bool:
    return any(entry.value for entry in facts.entries)


def _dressed(
    facts: ObjectFacts, stored: Mapping[int, Entry], live: Mapping[int, Entry]
) -> dict[int, Entry]:
    """Return the entries of the file, with the behaviour of those of the device.

    If the file has no description of the object, it has only the entries that were in use.
    """
    aborts = {entry.subindex: entry.abort for entry in facts.entries}
    unused = {} if facts.code else {k: each for k, each in live.items() if k not in stored}
    return unused | {
        subindex: _with_behaviour(
            aborts.get(subindex), entry if facts.code else live[subindex], live[subindex]
        )
        if subindex in live
        else entry
        for subindex, entry in stored.items()
    }


def _with_behaviour(abort: int | None, described: Entry, live: Entry) -> Entry:
    read = _read_unless_empty(live, abort) if abort else live.read
    return replace(described, read=read, write=live.write)


def _read_unless_empty(live: Entry, abort: int) -> Callable[[], bytes]:
    """Return a read that aborts as recorded while the place of a table is empty."""

    def read() -> bytes:
        value = live.read()
        if not any(value):
            raise Abort(abort)
        return value

    return read
