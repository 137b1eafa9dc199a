"""Voe: messages of the vendor-specific protocol of one device, before and during a loop."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from catenary.bus.pending import Pending
from catenary.bus.protocol_channel import protocol_channel
from catenary.bus.sdo import MailboxOwner
from catenary.errors import DecodeError
from catenary.model.device import Identity
from catenary.procedure.delivery import await_delivery
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.voe import ANSWER_TIMEOUT, exchange, send
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.voe import VoeMessage, decode_voe

MESSAGES_KEPT = 64


class VendorDevice(MailboxOwner, Protocol):
    """Interface to the device; `SubDevice` implements it."""

    @property
    def identity(self) -> Identity: ...


class Voe:
    """Messages of the vendor-specific protocol of one device (VoE).

    Example: `answer = sub.voe.exchange(1, b"ping").data`.

    `exchange`, `send` and `receive` wait. While a loop runs, any thread except the iterating one
    may call them. The iterating thread uses `request`, `request_send` and `take`, which do not
    wait.
    """

    def __init__(self, sub: VendorDevice, *, unavailable: str = "") -> None:
        """Initialise the access.

        Args:
            sub: The device.
            unavailable: Reason why the master does not offer VoE; empty if it does.
        """
        self._sub = sub
        self._unavailable = unavailable
        self._received: deque[VoeMessage] = deque(maxlen=MESSAGES_KEPT)
        self.dropped = 0  # messages that were dropped because 64 were stored

    def exchange(
        self,
        type: int,
        data: bytes = b"",
        *,
        vendor: int | None = None,
        timeout: float = ANSWER_TIMEOUT,
    ) -> VoeMessage:
        """Send a message, and return the next VoE message of the device.

        The standard does not connect answers with requests. `type` and `vendor` of the answer are
        those of the device.

        Args:
            type: Vendor type, 16 bits.
            data: The data.
            vendor: Vendor ID, 32 bits; None: that of the device.
            timeout: Longest time until the device answers [s].

        Raises:
            ResponseTimeout: The device does not answer.
            MailboxError: The device violates the protocol, or does not support VoE.
            ValueError: The message does not fit into the mailbox.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        asked = exchange(self._channel(), self._message(type, data, vendor), timeout)
        return self._sub.main.converse(asked)

    def request(
        self, type: int, data: bytes = b"", *, vendor: int | None = None
    ) -> Pending[VoeMessage]:
        """Send a message while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` returns the answer or raises the error. The arguments are those of `exchange`.
        Without a loop, the call waits for the answer.
        """
        asked = exchange(self._channel(), self._message(type, data, vendor))
        return self._sub.main.request(asked)

    def send(self, type: int, data: bytes = b"", *, vendor: int | None = None) -> None:
        """Send a message that the device does not answer. The arguments are those of `exchange`."""
        self._sub.main.converse(send(self._channel(), self._message(type, data, vendor)))

    def request_send(
        self, type: int, data: bytes = b"", *, vendor: int | None = None
    ) -> Pending[None]:
        """Send a message that the device does not answer, without waiting, as `request` does."""
        asked = send(self._channel(), self._message(type, data, vendor))
        return self._sub.main.request(asked)

    def receive(self, timeout: float = 1.0) -> VoeMessage | None:
        """Wait for a message that was not requested; None if none arrives.

        Messages are stored from the first call of a method on.

        Args:
            timeout: Longest time to wait [s]; 0: read the mailbox once.

        Raises:
            MailboxError: The device has no mailbox, or sent an invalid message.
            ValueError: The timeout is negative or infinite.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        if not self._received:
            self._sub.main.converse(await_delivery(self._channel(), self._received, timeout))
        return self.take()

    def take(self) -> VoeMessage | None:
        """Return and remove the oldest stored message; None if there is none. Does not wait."""
        self._channel()
        return self._received.popleft() if self._received else None

    def _message(self, type: int, data: bytes, vendor: int | None) -> VoeMessage:
        return VoeMessage(
            self._sub.identity.vendor if vendor is None else vendor, type, bytes(data)
        )

    def _channel(self) -> MailboxChannel:
        """Return the mailbox, and receive its messages."""
        channel = protocol_channel(self._sub, "VoE", self._unavailable)
        channel.subscribers[Type.VOE] = self._keep
        return channel

    def _keep(self, received: Mailbox, _time_ns: int) -> bool:
        try:
            message = decode_voe(received.data)
        except DecodeError:
            return False  # counted as a dropped message
        self.dropped += len(self._received) == MESSAGES_KEPT
        self._received.append(message)
        return True
