"""Mailbox of a device for a protocol that is not available in BOOT."""

from __future__ import annotations

from catenary.bus.sdo import MailboxOwner
from catenary.errors import CatenaryError, ConfigurationError, MailboxError
from catenary.procedure.mailbox import MailboxChannel


def protocol_channel(sub: MailboxOwner, protocol: str, unavailable: str) -> MailboxChannel:
    """Return the mailbox of a device.

    Args:
        sub: The device.
        protocol: Name of the protocol, for errors.
        unavailable: Reason why the master does not offer the protocol; empty if it does.

    Raises:
        ConfigurationError: The master does not offer the protocol.
        MailboxError: The device has no mailbox, or is in BOOT.
    """
    in_boot = MailboxError(
        f"{sub.station} is in BOOT, which has no {protocol}",
        hint='bring it to PRE-OP: sub.request_state("PREOP")',
    )
    without = MailboxError(
        f"{sub.station} has no mailbox: it does not support {protocol}",
        hint="couplers and simple terminals have no mailbox",
    )
    return usable_channel(sub, unavailable, in_boot, without)


def usable_channel(
    sub: MailboxOwner, unavailable: str, in_boot: CatenaryError, without: CatenaryError
) -> MailboxChannel:
    """Return the mailbox of a device, or raise the error that applies first.

    Args:
        sub: The device.
        unavailable: Reason why the master does not offer the protocol; empty if it does.
        in_boot: Error if the device is in BOOT.
        without: Error if the device has no mailbox.

    Raises:
        ConfigurationError: The master does not offer the protocol.
        CatenaryError: `in_boot`, the error of the scan, or `without`.
    """
    if unavailable:
        raise ConfigurationError(f"{sub.station}: {unavailable}")
    if sub.in_boot:
        raise in_boot
    if sub.error is not None:
        raise sub.error
    if sub.channel is None:
        raise without
    return sub.channel
