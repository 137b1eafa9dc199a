"""Facts of an ESI added to the description of a device.

The order of trust is: what the application requests, what the device reports (CoE), the ESI, the
SII. Exceptions: a name, an order code and mailbox properties that the SII states are kept.

This module only changes descriptions. A contradiction becomes a note; nothing is written.

TwinCAT compares vendor and product, and the revision by `CheckRevisionNo`, before PRE-OP. IgH and
SOEM do not compare revisions. Catenary keeps the device, but does not use an ESI whose rule refuses
its revision.
"""

from __future__ import annotations

from dataclasses import replace

from catenary.errors import IdentityError
from catenary.esi.configured import with_slots
from catenary.esi.device import EsiDevice, RevisionCheck
from catenary.esi.lookup import accepts
from catenary.esi.object_descriptions import documented_objects
from catenary.esi.process_data import with_process_data
from catenary.esi.settings import with_settings
from catenary.esi.sii import bootstrap_areas
from catenary.model.describe import bootstrap_mailbox
from catenary.model.device import DeviceDescription, MailboxLayout


def applied(description: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description, completed by the ESI of the device.

    Args:
        description: Description of the device, from its SII or its dictionary.
        esi: ESI of the device.

    Raises:
        IdentityError: The ESI describes another device, or its `CheckRevisionNo` refuses the
            revision of the device.
    """
    check_key(description, esi)
    device = with_settings(description, esi)
    device = with_process_data(device, esi)
    device = replace(
        device,
        name=_name(device, esi),
        order=device.order or esi.type,
        group=device.group or esi.group,
        documented=documented_objects(esi.dictionary),
        bootstrap=device.bootstrap or _bootstrap(esi),
        esi=str(esi.source),
        notes=(*device.notes, *_revision_note(device, esi)),
    )
    return with_slots(device, esi)


def _bootstrap(esi: EsiDevice) -> MailboxLayout | None:
    """Return the bootstrap mailbox of the ESI, for a device without one in its SII."""
    if esi.eeprom is None:
        return None
    return bootstrap_mailbox(*bootstrap_areas(esi.eeprom.bootstrap), str(esi.source))


def check_key(description: DeviceDescription, esi: EsiDevice) -> None:
    """Check that an ESI describes a device.

    Args:
        description: Description of the device.
        esi: ESI to check.

    Raises:
        IdentityError: Vendor or product differ, or `CheckRevisionNo` refuses the revision.
    """
    found = description.identity
    if (found.vendor, found.product) != (esi.key.vendor, esi.key.product):
        raise IdentityError(
            f"{description}: {esi.source} describes another device: {esi.type}, {esi.key}; the "
            f"device is 0x{found.vendor:08X}:0x{found.product:08X}:0x{found.revision:08X}",
            position=description.position,
            expected=esi.key,
            found=found,
            hint="use the ESI file of this device; its vendor offers it for download",
        )
    check = esi.revision_check
    if check is RevisionCheck.NONE or accepts(check, found.revision, esi.key.revision):
        return
    raise IdentityError(
        f"{description}: {esi.source} is not for its revision 0x{found.revision:08X}: the file "
        f"describes 0x{esi.key.revision:08X} with CheckRevisionNo={esi.revision_check.value}",
        position=description.position,
        expected=esi.key,
        found=found,
        hint="get the ESI file of this revision from the vendor",
    )


def _revision_note(device: DeviceDescription, esi: EsiDevice) -> list[str]:
    """Return a note if the revisions differ and the ESI has no rule for them."""
    same = device.identity.revision == esi.key.revision
    if same or not esi.key.revision or esi.revision_check is not RevisionCheck.NONE:
        return []
    return [
        f"{esi.source}: its ESI is for revision 0x{esi.key.revision:08X}, but its revision is "
        f"0x{device.identity.revision:08X}"
    ]


def _name(device: DeviceDescription, esi: EsiDevice) -> str:
    """Return the name of the SII; without one, the type of the ESI."""
    is_number = device.name.startswith("0x") and ":0x" in device.name
    return esi.type or esi.name if is_number or not device.name else device.name
