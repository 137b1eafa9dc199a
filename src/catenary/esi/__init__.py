"""EtherCAT SubDevice Information (ESI, ETG.2000): vendors' device description files.

from catenary.esi import Library

library = Library()
library.add("Beckhoff_EtherCAT_XML.zip")
device = library.find(vendor=2, product=0x07D43052, revision=0x00120000)

Names are imported on first use: a scan without ESI files needs none of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.esi.device import (
        DeviceKey,
        EsiController,
        EsiDevice,
        EsiEeprom,
        EsiEepromCategory,
        EsiEntry,
        EsiFile,
        EsiIdnCommand,
        EsiInitCommand,
        EsiMailbox,
        EsiMapping,
        EsiModeSyncManager,
        EsiModule,
        EsiOpMode,
        EsiPdo,
        EsiSlot,
        EsiSlots,
        EsiSyncManager,
        EsiTimeouts,
        EsiWatchdog,
        ModuleLabel,
        RevisionCheck,
    )
    from catenary.esi.dictionary import (
        EsiArray,
        EsiDataType,
        EsiDictionary,
        EsiObject,
        EsiObjectEntry,
        EsiSubItem,
    )
    from catenary.esi.library import Added, Library
    from catenary.esi.lookup import Choice, Rule
    from catenary.esi.reader import read_esi
    from catenary.esi.record import FileIndex, IndexEntry, Kind, Record
    from catenary.esi.source import EsiWarning, Source

__all__ = [
    "Added",
    "Choice",
    "DeviceKey",
    "EsiArray",
    "EsiController",
    "EsiDataType",
    "EsiDevice",
    "EsiDictionary",
    "EsiEeprom",
    "EsiEepromCategory",
    "EsiEntry",
    "EsiFile",
    "EsiIdnCommand",
    "EsiInitCommand",
    "EsiMailbox",
    "EsiMapping",
    "EsiModeSyncManager",
    "EsiModule",
    "EsiObject",
    "EsiObjectEntry",
    "EsiOpMode",
    "EsiPdo",
    "EsiSlot",
    "EsiSlots",
    "EsiSubItem",
    "EsiSyncManager",
    "EsiTimeouts",
    "EsiWarning",
    "EsiWatchdog",
    "FileIndex",
    "IndexEntry",
    "Kind",
    "Library",
    "ModuleLabel",
    "Record",
    "RevisionCheck",
    "Rule",
    "Source",
    "read_esi",
]

_NAMES = {
    "device": (
        "DeviceKey",
        "EsiController",
        "EsiDevice",
        "EsiEeprom",
        "EsiEepromCategory",
        "EsiEntry",
        "EsiFile",
        "EsiIdnCommand",
        "EsiInitCommand",
        "EsiMailbox",
        "EsiMapping",
        "EsiModeSyncManager",
        "EsiModule",
        "EsiOpMode",
        "EsiPdo",
        "EsiSlot",
        "EsiSlots",
        "EsiSyncManager",
        "EsiTimeouts",
        "EsiWatchdog",
        "ModuleLabel",
        "RevisionCheck",
    ),
    "dictionary": (
        "EsiArray",
        "EsiDataType",
        "EsiDictionary",
        "EsiObject",
        "EsiObjectEntry",
        "EsiSubItem",
    ),
    "lookup": ("Choice", "Rule"),
    "record": ("FileIndex", "IndexEntry", "Kind", "Record"),
    "source": ("EsiWarning", "Source"),
    "library": ("Added", "Library"),
    "reader": ("read_esi",),
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    return getattr(import_module(f"catenary.esi.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
