"""Gate: application of the policy to one message, immediately before it is sent."""

from __future__ import annotations

from collections.abc import Collection

from catenary.bus import MainDevice, SubDevice
from catenary.gateway.exchange import POWERED, read_axis_states
from catenary.gateway.policy import axis_enabled, is_dangerous, is_read, not_allowed
from catenary.gateway.refusal import Refusal
from catenary.gateway.request import Access, Request
from catenary.gateway.transfer import Transfer
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.wire.sii import MailboxProtocol


class Gate:
    """Permissions of a gateway, and the states of the axes."""

    def __init__(self, main: MainDevice, allowed: Collection[int]) -> None:
        self._main = main
        self._allowed = allowed  # positions of the devices that clients may write to

    def refusal(
        self, sub: SubDevice, channel: MailboxChannel, request: Request, transfer: Transfer | None
    ) -> Procedure[Refusal | None]:
        """Return the refusal of a message; None if it may pass.

        The caller must have the turn in the queue of the mailbox.

        Args:
            sub: The device.
            channel: Its mailbox.
            request: The message.
            transfer: Transfer that the message continues; None if it begins one.
        """
        if request.access is Access.END or is_read(request, transfer):
            return None
        if sub.position not in self._allowed:
            return not_allowed(request)
        if not is_dangerous(request, transfer, sub.description):
            return None
        # Within a transfer, reading the statusword would end it
        unknown = None if transfer is not None else (yield from self._not_at_rest(sub, channel))
        why = unknown or self._powered(sub)
        return None if why is None else axis_enabled(request, why)

    def _powered(self, sub: SubDevice) -> str | None:
        """Return the reason if the loop has enabled an axis, or does not know it."""
        axes = self._main.powered_axes(sub.position)
        if axes:
            return f"{', '.join(axes)} enabled; disable the axis first"
        if axes is None and self._main.has_loop:
            return "the loop does not report its axes"
        return None

    def _not_at_rest(self, sub: SubDevice, channel: MailboxChannel) -> Procedure[str | None]:
        """Return the reason if the device itself reports power, or its state is not known."""
        if not sub.is_drive:
            serves_soe = MailboxProtocol.SOE in channel.layout.protocols
            return "a SERCOS drive in a loop" if serves_soe and self._main.has_loop else None
        if sub.in_boot:
            return None  # in BOOT, a drive has no power stage and no objects
        states = yield from read_axis_states(channel, sub.slots)
        if None in states:
            return "the state of its axes (0x6041) cannot be read"
        powered = [state.name for state in states if state in POWERED and state is not None]
        return f"an axis is in {powered[0]}; disable it first" if powered else None
