"""General facts of an ESI device: timeouts, watchdogs, controller, alternative mappings."""

from __future__ import annotations

from catenary.esi.device import EsiController, EsiMapping, EsiTimeouts, EsiWatchdog
from catenary.esi.findings import Findings, text_of
from catenary.esi.xml import Element

# Beckhoff's files have them in Info; catio_terminals (xml_pdo_groups.py) and taktora-ethercat-esi
# (parser) read this path. Other vendors place VendorSpecific directly in Device.
MAPPING_PLACES = ("Info/VendorSpecific/TwinCAT", "VendorSpecific/TwinCAT", "Info/VendorSpecific")


def read_timeouts(device: Element, findings: Findings) -> EsiTimeouts:
    """Return the timeouts of state changes and of the mailbox.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    states = device.at("Info/StateMachine/Timeout")
    mailbox = device.at("Info/Mailbox/Timeout")
    return EsiTimeouts(
        pre_op=_number(states, "PreopTimeout", findings),
        safe_op_and_op=_number(states, "SafeopOpTimeout", findings),
        back_to_init=_number(states, "BackToInitTimeout", findings),
        back_to_safe_op=_number(states, "BackToSafeopTimeout", findings),
        mailbox_request=_number(mailbox, "RequestTimeout", findings),
        mailbox_response=_number(mailbox, "ResponseTimeout", findings),
    )


def read_watchdog(device: Element, findings: Findings) -> EsiWatchdog:
    """Return the watchdog registers that the file requests.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    registers = device.find("ESC")
    return EsiWatchdog(
        divider=_number(registers, "Reg0400", findings, bits=16),
        pdi=_number(registers, "Reg0410", findings, bits=16),
        sync_managers=_number(registers, "Reg0420", findings, bits=16),
    )


def read_controller(device: Element, findings: Findings) -> EsiController:
    """Return the controller of a device.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    controller = device.at("Info/EtherCATController")
    return EsiController(
        dpram_size=_number(controller, "DpramSize", findings) or 0,
        sync_manager_count=_number(controller, "SmCount", findings, bits=8) or 0,
        fmmu_count=_number(controller, "FmmuCount", findings, bits=8) or 0,
    )


def read_mappings(device: Element, findings: Findings) -> tuple[EsiMapping, ...]:
    """Return the named assignments of PDOs (`AlternativeSmMapping`).

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    places = (device.at(path) for path in MAPPING_PLACES)
    return tuple(
        _mapping(element, findings)
        for place in places
        if place is not None
        for element in place.all("AlternativeSmMapping")
    )


def read_identification(device: Element, findings: Findings) -> tuple[int | None, bool]:
    """Return the register of the explicit device identification, and True if the AL status has it.

    `IdentificationReg134` denotes register 0x0134, the AL status code (ETG.1020).

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    info = device.find("Info")
    by_al_status = findings.flag(info.find("IdentificationReg134") if info is not None else None)
    register = _number(info, "IdentificationAdo", findings, bits=16)
    return (0x0134 if by_al_status and register is None else register), by_al_status


def read_current(device: Element, findings: Findings) -> int:
    """Return the current from the E-bus [mA]; negative for a supply.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    return findings.integer(device.at("Info/Electrical/EBusCurrent"), signed=True)


def _mapping(element: Element, findings: Findings) -> EsiMapping:
    pdos = []
    for manager in element.all("Sm"):
        number = findings.number(manager, "No", bits=8)
        if number is None:
            findings.warn(manager, "Sm of an AlternativeSmMapping without a number is ignored")
            continue
        indices = (findings.number(pdo, bits=16) for pdo in manager.all("Pdo"))
        pdos.append((number, tuple(index for index in indices if index is not None)))
    return EsiMapping(
        name=text_of(element, "Name"),
        default=findings.flag(element, "Default"),
        pdos=tuple(pdos),
        source=findings.source(element),
    )


def _number(parent: Element | None, tag: str, findings: Findings, *, bits: int = 32) -> int | None:
    return findings.number(parent.find(tag), bits=bits) if parent is not None else None


def read_diagnosis_texts(device: Element, findings: Findings) -> dict[int, str]:
    """Return the texts of diagnosis messages by text ID (`Profile/DiagMessages/DiagMessage`).

    Of several texts with one ID, the first counts.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    texts: dict[int, str] = {}
    for profile in device.all("Profile"):
        for messages in profile.all("DiagMessages"):
            for message in messages.all("DiagMessage"):
                number = findings.required(message, "TextId", bits=16)
                text = text_of(message, "MessageText")
                if number is not None and text:
                    texts.setdefault(number, text)
    return texts
