"""Modules of ESI files, and the profiles that devices and modules have in common."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from catenary.errors import EsiError
from catenary.esi.device import EsiDevice, EsiModule, EsiSlots, ModuleLabel
from catenary.esi.dictionary import EsiDataType, EsiDictionary, EsiObject
from catenary.esi.findings import Findings, text_of
from catenary.esi.mailbox import read_init_commands
from catenary.esi.objects import read_dictionary
from catenary.esi.pdos import read_pdos
from catenary.esi.values import file_name
from catenary.esi.xml import Element


class Profile(NamedTuple):
    """Profile numbers and dictionary of a device or module, from all its profiles."""

    number: int | None
    channels: tuple[int, ...]
    dictionary: EsiDictionary | None
    dictionary_file: str


def make_module(element: Element, findings: Findings) -> EsiModule:
    """Return a module.

    Args:
        element: The element `Module`.
        findings: The warnings of the reader.

    Raises:
        EsiError: The module has no valid identification.
    """
    kind = element.find("Type")
    ident = findings.number(kind, "ModuleIdent")
    if kind is None or ident is None:
        raise EsiError("module without a valid ModuleIdent", file=findings.file, line=element.line)
    profile = read_profile(element, findings)
    return EsiModule(
        ident=ident,
        type=text_of(element, "Type"),
        name=text_of(element, "Name"),
        module_class=kind.attributes.get("ModuleClass", "").strip(),
        pdo_group=findings.integer(kind, "ModulePdoGroup", bits=16),
        pdos=read_pdos(element, findings),
        init_commands=read_init_commands(element.find("Mailbox"), findings),
        dictionary=profile.dictionary,
        dictionary_file=profile.dictionary_file,
        source=findings.source(element),
    )


def with_modules(device: EsiDevice, modules: Iterable[EsiModule]) -> EsiDevice:
    """Return a device with the modules that its slots accept.

    Args:
        device: The device, without modules.
        modules: The modules that were found.
    """
    if device.slots is None:
        return device
    accepted = accepted_modules(device.slots, modules)
    labels = tuple(
        ModuleLabel(each.ident, each.type or each.name, each.module_class) for each in accepted
    )
    return replace(device, slots=replace(device.slots, labels=labels), modules=accepted)


def accepted_modules(slots: EsiSlots | None, modules: Iterable[EsiModule]) -> tuple[EsiModule, ...]:
    """Return the modules that the slots of a device accept, by ident or class.

    Args:
        slots: The slots; None if the device is not modular.
        modules: The modules that were found.
    """
    if slots is None:
        return ()
    return tuple(
        module
        for module in modules
        if any(slot.accepts(module.ident, module.module_class) for slot in slots.slots)
    )


def read_profile(parent: Element, findings: Findings) -> Profile:
    """Return the profiles of a device or module as one.

    Args:
        parent: The device or module.
        findings: The warnings of the reader.
    """
    profiles = parent.all("Profile")
    numbers = (findings.number(each.find("ProfileNo"), bits=16) for each in profiles)
    channels = [
        number
        for each in profiles
        for channel in each.all("ChannelInfo")
        if (number := findings.number(channel.find("ProfileNo"), bits=16)) is not None
    ]
    files = (child for each in profiles for child in each.all("DictionaryFile"))
    declared = [child for each in profiles for child in each.all("Dictionary")]
    first = next((number for number in numbers if number is not None), None)
    return Profile(
        number=channels[0] if first is None and channels else first,
        channels=tuple(channels),
        dictionary=_merged([read_dictionary(each, findings) for each in declared]),
        dictionary_file=next((file_name(child.text) for child in files if child.text.strip()), ""),
    )


def _merged(dictionaries: list[EsiDictionary]) -> EsiDictionary | None:
    """Return the dictionaries of all profiles as one; None without any."""
    if len(dictionaries) < 2:
        return dictionaries[0] if dictionaries else None
    types: dict[str, EsiDataType] = {}
    objects: dict[int, EsiObject] = {}
    for each in reversed(dictionaries):  # the first one counts
        types.update(each.types)
        objects.update(each.objects)
    return EsiDictionary(types, objects)
