"""Devices of ESI files (`Device`; ETG.2000, DeviceType)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from catenary.errors import EsiError
from catenary.esi.clocks import read_op_modes
from catenary.esi.device import (
    DeviceKey,
    EsiDevice,
    EsiModule,
    EsiPdo,
    EsiSyncManager,
    RevisionCheck,
)
from catenary.esi.eeprom import read_eeprom
from catenary.esi.findings import Findings, text_of
from catenary.esi.info import (
    read_controller,
    read_current,
    read_diagnosis_texts,
    read_identification,
    read_mappings,
    read_timeouts,
    read_watchdog,
)
from catenary.esi.known_elements import DEVICE, unknown_paths
from catenary.esi.mailbox import read_mailbox
from catenary.esi.modules import read_profile, with_modules
from catenary.esi.pdos import read_pdos
from catenary.esi.slots import read_slots
from catenary.esi.sync_managers import read_fmmus, read_sync_managers
from catenary.esi.values import plain_text, shown
from catenary.esi.xml import Element

NEXT_STEP = "correct the attribute, or obtain the file again from the vendor"


class Vendor(NamedTuple):
    """Vendor of the devices in a file."""

    number: int
    name: str = ""


def read_vendor(element: Element | None, findings: Findings, default: Vendor) -> Vendor:
    """Return the vendor in an element.

    Args:
        element: The element `Vendor`; None if the file does not have it.
        findings: The warnings of the reader.
        default: The vendor without a valid element.
    """
    if element is None:
        return default
    number = findings.required(element, "Id")
    if number is None:
        return default
    return Vendor(number, text_of(element, "Name"))


def read_key(element: Element, vendor: Vendor, findings: Findings) -> DeviceKey:
    """Return vendor, product and revision of a device.

    Args:
        element: The element `Device`.
        vendor: The vendor of the file.
        findings: The warnings of the reader.

    Raises:
        EsiError: The product code or the revision is not a number of 32 bits.
    """
    vendor = read_vendor(element.find("Vendor"), findings, vendor)
    kind = element.find("Type")
    if kind is None or "ProductCode" not in kind.attributes:
        findings.warn(element, "the device has no ProductCode; 0 assumed")
    return DeviceKey(
        vendor.number,
        _identifier(kind, "ProductCode", findings),
        _identifier(kind, "RevisionNo", findings),
    )


def make_device(
    element: Element, vendor: Vendor, findings: Findings, modules: Iterable[EsiModule] = ()
) -> EsiDevice:
    """Return a device with its warnings.

    Args:
        element: The element `Device`.
        vendor: The vendor of the file.
        findings: The warnings of the reader, for this device only.
        modules: Modules for the slots of the device.

    Raises:
        EsiError: The device has no valid identification.
    """
    device = _with_process_data(_identified(element, vendor, findings), element, findings)
    device = _with_services(device, element, findings)
    return replace(
        with_modules(device, modules),
        unknown=unknown_paths(element, DEVICE),
        warnings=tuple(findings.warnings),
    )


def _identified(element: Element, vendor: Vendor, findings: Findings) -> EsiDevice:
    """Return a device with its identification and its relations to other devices."""
    key = read_key(element, vendor, findings)
    kind = element.find("Type")
    return EsiDevice(
        key=key,
        vendor_name=text_of(element.find("Vendor"), "Name") or vendor.name,
        type=text_of(element, "Type"),
        name=text_of(element, "Name") or text_of(element, "Type"),
        group=text_of(element, "GroupType"),
        physics=element.attributes.get("Physics", ""),
        revision_check=_revision_check(kind, findings),
        hides=_keys(element, "HideType", key, findings),
        alternatives=_keys(element, "AlternativeType", key, findings),
        sub_devices=tuple(plain_text(child.text) for child in element.all("SubDevice")),
        use_lrd_lwr=findings.flag(kind, "UseLrdLwr"),
        config_in_safe_op=findings.flag(kind, "TcCfgModeSafeOp"),
        source=findings.source(element),
    )


def _with_process_data(device: EsiDevice, element: Element, findings: Findings) -> EsiDevice:
    """Return a device with SyncManagers, PDOs, clocks and slots."""
    managers = read_sync_managers(element, findings)
    pdos = (_assigned(pdo, managers, element, findings) for pdo in read_pdos(element, findings))
    return replace(
        device,
        fmmus=read_fmmus(element),
        sync_managers=managers,
        pdos=tuple(pdos),
        has_clock=element.find("Dc") is not None,
        op_modes=read_op_modes(element, findings),
        alternative_mappings=read_mappings(element, findings),
        slots=read_slots(element, findings),
    )


def _with_services(device: EsiDevice, element: Element, findings: Findings) -> EsiDevice:
    """Return a device with its mailbox, dictionary, EEPROM and general facts."""
    profile = read_profile(element, findings)
    register, by_al_status = read_identification(element, findings)
    return replace(
        device,
        profile=profile.number,
        profile_channels=profile.channels,
        mailbox=read_mailbox(element, findings),
        dictionary=profile.dictionary,
        dictionary_file=profile.dictionary_file,
        controller=read_controller(element, findings),
        timeouts=read_timeouts(element, findings),
        watchdog=read_watchdog(element, findings),
        eeprom=read_eeprom(element, findings),
        e_bus_current_ma=read_current(element, findings),
        diagnosis_texts=read_diagnosis_texts(element, findings),
        identification_register=register,
        identifies_by_al_status=by_al_status,
    )


def _identifier(kind: Element | None, attribute: str, findings: Findings) -> int:
    """Return a product code or revision; 0 without the attribute."""
    number = findings.number(kind, attribute)
    text = kind.attributes.get(attribute, "").strip() if kind is not None else ""
    if kind is not None and text and number is None:
        raise EsiError(
            f"{attribute} {shown(text)} is not a number of 32 bits",
            file=findings.file,
            line=kind.line,
            hint=NEXT_STEP,
        )
    return number or 0


def _revision_check(kind: Element | None, findings: Findings) -> RevisionCheck:
    text = kind.attributes.get("CheckRevisionNo", "").strip() if kind is not None else ""
    if kind is None or text in ("", "NONE"):
        return RevisionCheck.NONE
    try:
        return RevisionCheck(text)
    except ValueError:
        findings.warn(kind, f"CheckRevisionNo: {shown(text)} is unknown; ignored")
        return RevisionCheck.NONE


def _keys(element: Element, tag: str, key: DeviceKey, findings: Findings) -> tuple[DeviceKey, ...]:
    """Return the devices that children name by product code, revision, or both."""
    found = []
    for child in element.all(tag):
        product = findings.number(child, "ProductCode")
        revision = findings.number(child, "RevisionNo")
        if product is not None or revision is not None:
            product = key.product if product is None else product
            found.append(DeviceKey(key.vendor, product, revision or 0))
    return tuple(found)


def _assigned(
    pdo: EsiPdo, managers: tuple[EsiSyncManager, ...], device: Element, findings: Findings
) -> EsiPdo:
    """Return a PDO whose SyncManager exists. Some files number them by another rule."""
    if pdo.sync_manager is None or pdo.sync_manager < len(managers):
        return pdo
    uses = [manager.index for manager in managers if manager.use is pdo.direction.use]
    repaired = uses[0] if len(uses) == 1 else None
    reaction = "not assigned" if repaired is None else f"assigned to SyncManager {repaired}"
    findings.warn(
        device._replace(line=pdo.source.line),
        f"PDO 0x{pdo.index:04X} is assigned to SyncManager {pdo.sync_manager}, which the device "
        f"does not have; {reaction}",
    )
    return replace(pdo, sync_manager=repaired)
