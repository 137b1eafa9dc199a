"""Slots of a modular ESI device (`Slots`; ETG.2000, SlotType; ETG.5001)."""

from __future__ import annotations

from catenary.esi.device import EsiSlot, EsiSlots
from catenary.esi.findings import Findings, text_of
from catenary.esi.values import plain_text
from catenary.esi.xml import Element


def read_slots(device: Element, findings: Findings) -> EsiSlots | None:
    """Return the slots of a device; None if it is not modular.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    element = device.find("Slots")
    if element is None:
        return None
    return EsiSlots(
        slots=tuple(_slot(child, findings) for child in element.all("Slot")),
        max_slot_count=findings.number(element, "MaxSlotCount", bits=16),
        pdo_increment=findings.integer(element, "SlotPdoIncrement", bits=16),
        index_increment=findings.integer(element, "SlotIndexIncrement", bits=16),
        download_module_idents=findings.flag(element, "DownloadModuleIdentList")
        or findings.flag(device.find("Type"), "DownloadModuleList"),  # obsolete form
        identify_by=element.attributes.get("IdentifyModuleBy", "").strip(),
    )


def _slot(element: Element, findings: Findings) -> EsiSlot:
    found = [(findings.number(child), child) for child in element.all("ModuleIdent")]
    idents = [(ident, child) for ident, child in found if ident is not None]
    default = (ident for ident, child in idents if findings.flag(child, "Default"))
    return EsiSlot(
        name=text_of(element, "Name"),
        min_instances=findings.integer(element, "MinInstances", bits=16),
        max_instances=findings.integer(element, "MaxInstances", bits=16, default=1),
        module_idents=tuple(ident for ident, _ in idents),
        default_ident=next(default, None),
        module_classes=tuple(_classes(element)),
        pdo_increment=findings.number(element, "SlotPdoIncrement", bits=16),
        index_increment=findings.number(element, "SlotIndexIncrement", bits=16),
        source=findings.source(element),
    )


def _classes(element: Element) -> list[str]:
    """Return the module classes: `ModuleClass/Class`, or the text of `ModuleClass`."""
    found = (child.find("Class") or child for child in element.all("ModuleClass"))
    return [name for child in found if (name := plain_text(child.text))]
