"""Comparison of mailbox protocols and CoE capabilities: ESI, SII, and behaviour of the device."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.esi.device import EsiDevice, EsiMailbox
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.model.coe_facts import CoeFacts
from catenary.wire.sii import MailboxProtocol, Sii
from catenary.wire.sii_categories import CoeDetails

PROTOCOL_BITS = 0x3F
MODULAR = 5001  # ETG.5001: the low word of 0x1000, also in devices whose ESI has channel profiles
EFFECTS = {
    MailboxProtocol.COE: "a master does not read the object dictionary if its source lacks CoE",
    MailboxProtocol.FOE: "a firmware update by FoE is refused or not offered",
    MailboxProtocol.EOE: "a tunnel for Ethernet (EoE) is refused or not offered",
}


def compare_capabilities(
    esi: EsiDevice, sii: Sii | None, coe: CoeFacts | None
) -> Iterator[Difference]:
    """Yield the differences of the mailbox protocols and of the CoE capabilities.

    Args:
        esi: The ESI.
        sii: The SII of the device; None if it cannot be decoded.
        coe: What the object dictionary gives; None if it was not read.
    """
    mailbox = esi.mailbox or EsiMailbox(MailboxProtocol(0), source=esi.source)
    if sii is not None:
        yield from _protocols(mailbox, sii)
    if MailboxProtocol.COE in mailbox.protocols:
        yield from _details(mailbox, sii, coe)
    if coe is not None:
        yield from _profile(esi, coe)


def _protocols(mailbox: EsiMailbox, sii: Sii) -> Iterator[Difference]:
    found = MailboxProtocol(sii.header.mailbox_protocols & PROTOCOL_BITS)
    for protocol in MailboxProtocol:
        given, own = protocol in mailbox.protocols, protocol in found
        if given == own:
            continue
        yield Difference(
            Severity.WARNING,
            Subject.MAILBOX,
            f"mailbox protocol {str(protocol.name).replace('OE', 'oE')}",
            Sides(_yes(given), _yes(own)),
            mailbox.source,
            EFFECTS.get(protocol, "the protocol is refused or not offered"),
            "check whether the firmware supports the protocol",
        )


def _details(mailbox: EsiMailbox, sii: Sii | None, coe: CoeFacts | None) -> Iterator[Difference]:
    """Yield the capabilities that differ. An SII without any CoE detail does not give them."""
    own = sii.general.coe if sii is not None and sii.general is not None else CoeDetails(0)
    facts = coe or CoeFacts()
    for name, bit, given, behaviour, reason in (
        (
            *("SDO information", CoeDetails.SDO_INFORMATION, mailbox.sdo_information),
            *(facts.sdo_information, "without it, types and names come from the ESI only"),
        ),
        (
            *("complete access", CoeDetails.COMPLETE_ACCESS, mailbox.complete_access),
            *(facts.complete_access, "start-up objects with CompleteAccess are refused without it"),
        ),
        (
            *("PDO assignment", CoeDetails.PDO_ASSIGN, mailbox.pdo_assign),
            *(facts.pdo_assign, "0x1C12 and 0x1C13 can be written only with it"),
        ),
        (
            *("PDO configuration", CoeDetails.PDO_CONFIGURATION, mailbox.pdo_configuration),
            *(None, "0x16xx and 0x1Axx can be written only with it"),
        ),
    ):
        sides = Sides(
            _yes(given),
            _yes(bit in own) if own else None,
            None if behaviour is None else _yes(behaviour),
        )
        if sides.differ:
            yield Difference(
                Severity.WARNING,
                Subject.CAPABILITY,
                name,
                sides,
                mailbox.source,
                reason,
                "rely on the behaviour of the device"
                if behaviour is not None
                else "if the device refuses it, remove it from your request",
            )


def _yes(value: bool) -> str:
    return "supported" if value else "not supported"


def _profile(esi: EsiDevice, coe: CoeFacts) -> Iterator[Difference]:
    """Yield the difference of the device profile (0x1000); 0 means none."""
    if coe.device_type is None or esi.profile is None:
        return
    found = coe.device_type & 0xFFFF
    if not found or found == esi.profile or MODULAR in (found, esi.profile):
        return
    yield Difference(
        Severity.WARNING,
        Subject.IDENTITY,
        "device profile (0x1000)",
        Sides(str(esi.profile), None, str(found)),
        esi.source,
        "drives are recognised by profile 402",
        "check whether the ESI belongs to this firmware",
    )
