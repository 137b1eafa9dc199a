"""Comparison of descriptions with the same key in several files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass

from catenary.errors import EsiError
from catenary.esi.device import EsiDevice
from catenary.esi.record import Record
from catenary.esi.source import EsiWarning, Source

IGNORED = {"source", "warnings", "unknown", "vendor_name"}
WORDS = {
    "pdos": "PDOs",
    "sync_managers": "SyncManagers",
    "op_modes": "OpModes",
    "dictionary": "object dictionary",
    "mailbox": "mailbox",
    "slots": "slots",
    "eeprom": "EEPROM",
    "name": "name",
    "type": "type",
}


def differences(first: EsiDevice, second: EsiDevice) -> list[str]:
    """Return what differs between two descriptions, without places and warnings.

    Args:
        first: A description.
        second: Another one.
    """
    return [
        WORDS.get(each.name, each.name.replace("_", " "))
        for each in fields(EsiDevice)
        if each.name not in IGNORED
        and _plain(getattr(first, each.name)) != _plain(getattr(second, each.name))
    ]


def _plain(value: object) -> object:
    """Return a value without the places in the file."""
    if isinstance(value, Source):
        return None
    if is_dataclass(value) and not isinstance(value, type):
        return tuple(_plain(getattr(value, each.name)) for each in fields(value))
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, tuple):
        return tuple(_plain(each) for each in value)
    return value


def warning_of(used: Record, other: Record, read: Callable[[Record], EsiDevice]) -> EsiWarning:
    """Return the warning for a second description of the same key.

    Args:
        used: The preferred description.
        other: The other one.
        read: Function that reads a description.
    """
    try:
        found = differences(read(used), read(other))
    except EsiError as error:
        text = f"{other.source} has the same key {used.key} and cannot be compared: {error.message}"
        return EsiWarning(used.source, text)
    if not found:
        text = f"{other.source} has the same description of {used.key}"
    else:
        text = f"{other.source} describes {used.key} differently: {', '.join(found)}"
    return EsiWarning(used.source, f"{text}; {used.source} is used")
