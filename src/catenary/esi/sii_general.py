"""General category of an SII image (ETG.2010, category 30), from an ESI."""

from __future__ import annotations

from catenary.esi.device import EsiDevice, EsiMailbox
from catenary.esi.sii_strings import SiiStrings
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import CoeDetails, General, GeneralFlags

DRIVES = 402  # device profile
GROUP_COPY = 1  # place of byte 14 in General.reserved: the number of the group once more
# Port types in 4 bits, ETG.2010: MII, E-bus, Fast Hot Connect; also in esctool (sii.cpp, Newtec)
PORTS = {"Y": 1, "K": 3, "H": 4}


def sii_general(device: EsiDevice, strings: SiiStrings) -> General:
    """Return the general category.

    Args:
        device: The device.
        strings: Strings of the image, which receive the names.
    """
    order = strings.number(device.type)  # in the order of Beckhoff's images: EL2004, DigOut ...
    group, name = strings.number(device.group), strings.number(device.name)
    mailbox = device.mailbox or EsiMailbox(MailboxProtocol(0))
    reserved = bytearray(15)
    reserved[GROUP_COPY] = group
    return General(
        group=group,
        order=order,
        name=name,
        coe=_coe_details(mailbox),
        foe=int(MailboxProtocol.FOE in mailbox.protocols),
        eoe=int(MailboxProtocol.EOE in mailbox.protocols),
        soe_channels=int(MailboxProtocol.SOE in mailbox.protocols),
        ds402_channels=_drive_channels(device, mailbox),
        flags=_general_flags(device, mailbox),
        current_ma=device.e_bus_current_ma,
        physical_ports=_ports(device.physics),
        identification_address=device.identification_register or 0,
        reserved=bytes(reserved),
    )


def _drive_channels(device: EsiDevice, mailbox: EsiMailbox) -> int:
    """Return the number of CiA 402 axes: that of the file, else the channels with profile 402."""
    channels = device.profile_channels.count(DRIVES) or int(device.profile == DRIVES)
    return min(mailbox.drive_channels or channels, 255)


def _coe_details(mailbox: EsiMailbox) -> CoeDetails:
    details = CoeDetails(0)
    if MailboxProtocol.COE not in mailbox.protocols:
        return details
    for given, bit in (
        (True, CoeDetails.SDO),
        (mailbox.sdo_information, CoeDetails.SDO_INFORMATION),
        (mailbox.pdo_assign, CoeDetails.PDO_ASSIGN),
        (mailbox.pdo_configuration, CoeDetails.PDO_CONFIGURATION),
        (mailbox.pdo_upload, CoeDetails.UPLOAD_AT_START),
        (mailbox.complete_access, CoeDetails.COMPLETE_ACCESS),
    ):
        details |= bit if given else 0
    return details


def _general_flags(device: EsiDevice, mailbox: EsiMailbox) -> int:
    by_memory = device.identification_register is not None and not device.identifies_by_al_status
    # TwinCAT takes bit 0 from Type/@TcCfgModeSafeOp, as other generators do (beremiz, BenchCAT).
    return (
        (GeneralFlags.SAFE_OP if device.config_in_safe_op else 0)
        | (GeneralFlags.NO_LRW if device.use_lrd_lwr else 0)
        | (GeneralFlags.MAILBOX_DATA_LINK_LAYER if mailbox.data_link_layer else 0)
        | (GeneralFlags.IDENTIFICATION_BY_AL_STATUS if device.identifies_by_al_status else 0)
        | (GeneralFlags.IDENTIFICATION_BY_MEMORY if by_memory else 0)
    )


def _ports(physics: str) -> int:
    """Return the types of the ports, 4 bits each; the first letter is port 0."""
    return sum(PORTS.get(letter, 0) << 4 * port for port, letter in enumerate(physics[:4].upper()))
