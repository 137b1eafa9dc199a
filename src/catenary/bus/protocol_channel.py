"""Mailbox of a device for a protocol that is not available in BOOT."""

from __future__ import annotations

from typing import Protocol

from catenary.bus.sdo import Conversations
from catenary.errors import CatenaryError, ConfigurationError, MailboxError
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.station import Station


class MailboxOwner(Protocol):
    """Interface to a device with a mailbox; `SubDevice` implements it."""

    @property
    def main(self) -> Conversations: ...

    @property
    def station(self) -> Station: ...

    @property
    def channel(self) -> MailboxChannel | None: ...

    @property
    def in_boot(self) -> bool: ...

    @property
    def error(self) -> CatenaryError | None: ...


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
    if unavailable:
        raise ConfigurationError(f"{sub.station}: {unavailable}")
    if sub.in_boot:
        raise MailboxError(
            f"{sub.station} is in BOOT, which has no {protocol}",
            hint='bring it to PRE-OP: sub.request_state("PREOP")',
        )
    if sub.error is not None:
        raise sub.error
    if sub.channel is None:
        raise MailboxError(
            f"{sub.station} has no mailbox: it does not support {protocol}",
            hint="couplers and simple terminals have no mailbox",
        )
    return sub.channel
