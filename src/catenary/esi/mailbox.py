"""Mailbox of an ESI device or module, and its InitCmds of CoE and SoE (`Mailbox`)."""

from __future__ import annotations

import re

from catenary.esi.device import EsiIdnCommand, EsiInitCommand, EsiMailbox
from catenary.esi.findings import Findings, text_of
from catenary.esi.values import plain_text, shown
from catenary.esi.xml import Element
from catenary.wire.sii import MailboxProtocol

PROTOCOLS = {
    "AoE": MailboxProtocol.AOE,
    "EoE": MailboxProtocol.EOE,
    "CoE": MailboxProtocol.COE,
    "FoE": MailboxProtocol.FOE,
    "SoE": MailboxProtocol.SOE,
    "VoE": MailboxProtocol.VOE,
}
DRIVES = tuple("01234567")
TRANSITION = re.compile("[IPSOB]{2}")


def read_mailbox(device: Element, findings: Findings) -> EsiMailbox | None:
    """Return the mailbox of a device; None if it has none.

    Args:
        device: The device.
        findings: The warnings of the reader.
    """
    element = device.find("Mailbox")
    if element is None:
        return None
    coe = element.find("CoE")
    protocols = MailboxProtocol(0)
    for child in element.children:
        protocols |= PROTOCOLS.get(child.tag, MailboxProtocol(0))
    return EsiMailbox(
        protocols=protocols,
        complete_access=findings.flag(coe, "CompleteAccess"),
        sdo_information=findings.flag(coe, "SdoInfo"),
        pdo_assign=findings.flag(coe, "PdoAssign"),
        pdo_configuration=findings.flag(coe, "PdoConfig"),
        pdo_upload=findings.flag(coe, "PdoUpload"),
        segmented_sdo=findings.flag(coe, "SegmentedSdo"),
        data_link_layer=findings.flag(element, "DataLinkLayer"),
        drive_channels=findings.integer(coe, "DS402Channels", bits=8),
        init_commands=read_init_commands(element, findings),
        idn_commands=_read_idn_commands(element, findings),
        source=findings.source(element),
    )


def read_init_commands(mailbox: Element | None, findings: Findings) -> tuple[EsiInitCommand, ...]:
    """Return the CoE InitCmds of a mailbox, in the order of the file.

    Args:
        mailbox: The mailbox; None if the file does not have one.
        findings: The warnings of the reader.
    """
    coe = mailbox.find("CoE") if mailbox is not None else None
    elements = coe.all("InitCmd") if coe is not None else ()
    found = (_init_command(element, findings) for element in elements)
    return tuple(command for command in found if command is not None)


def _init_command(element: Element, findings: Findings) -> EsiInitCommand | None:
    """Return an InitCmd; None if it cannot be sent."""
    index = findings.required(element, "Index", bits=16)
    data = findings.data(element.find("Data"))
    transitions = _transitions(element, findings)
    if index is None or data is None or not transitions:
        findings.warn(element, "InitCmd without index, data or transition is ignored")
        return None
    return EsiInitCommand(
        transitions=transitions,
        index=index,
        subindex=findings.integer(element.find("SubIndex"), bits=8),
        data=data,
        complete_access=findings.flag(element, "CompleteAccess"),
        fixed=findings.flag(element, "Fixed"),
        overwritten_by_module=findings.flag(element, "OverwrittenByModule"),
        depends_on_slot=findings.flag(element.find("Index"), "DependOnSlot"),
        timeout_ms=findings.integer(element.find("Timeout")),
        comment=text_of(element, "Comment"),
        source=findings.source(element),
    )


def _read_idn_commands(mailbox: Element, findings: Findings) -> tuple[EsiIdnCommand, ...]:
    """Return the SoE InitCmds of a mailbox, in the order of the file."""
    soe = mailbox.find("SoE")
    elements = soe.all("InitCmd") if soe is not None else ()
    found = (_idn_command(element, findings) for element in elements)
    return tuple(command for command in found if command is not None)


def _idn_command(element: Element, findings: Findings) -> EsiIdnCommand | None:
    """Return an InitCmd; None if it cannot be sent."""
    number = findings.required(element, "IDN", bits=16)
    data = findings.data(element.find("Data"))
    transitions = _transitions(element, findings)
    drive = element.attributes.get("Chn", "0").strip()
    if number is None or data is None or not transitions:
        findings.warn(element, "InitCmd without IDN, data or transition is ignored")
        return None
    if drive not in DRIVES:
        findings.warn(element, f"InitCmd with Chn {shown(drive)} is ignored: it must be 0 to 7")
        return None
    return EsiIdnCommand(
        transitions=transitions,
        number=number,
        data=data,
        drive=int(drive),
        comment=text_of(element, "Comment"),
        source=findings.source(element),
    )


def _transitions(element: Element, findings: Findings) -> tuple[str, ...]:
    found: dict[str, None] = {}  # in the order of the file, without duplicates
    for child in element.all("Transition"):
        text = plain_text(child.text).upper()
        if TRANSITION.fullmatch(text):
            found[text] = None
        else:
            findings.warn(child, f"unknown transition {shown(child.text)}; ignored")
    return tuple(found)
