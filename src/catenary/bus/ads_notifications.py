"""Notifications of an ADS device: values that it sends on its own."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from types import TracebackType

from catenary.bus.sdo import Conversations
from catenary.errors import AdsError, DecodeError
from catenary.procedure.aoe import AdsPeer, request
from catenary.procedure.delivery import await_delivery
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel
from catenary.wire.ads import DeleteNotification
from catenary.wire.ads_response import Sample, decode_notification
from catenary.wire.aoe import Command, Message, decode_aoe
from catenary.wire.mailbox import Mailbox, Type

NOTIFICATIONS_KEPT = 1024  # samples of one subscription
EARLY_KEPT = 64  # samples that arrive before their handle is known


class NotificationQueues:
    """Queues of the samples of one device, by port and handle."""

    def __init__(self) -> None:
        self._queues: dict[tuple[int, int], SampleQueue] = {}
        self._early: deque[tuple[int, Sample]] = deque(maxlen=EARLY_KEPT)

    def listen(self, channel: MailboxChannel) -> None:
        """Receive the notifications of a mailbox."""
        channel.subscribers[Type.AOE] = self.take

    def take(self, received: Mailbox, _time_ns: int) -> bool:
        """Store the samples of a message. Return True if it was a notification."""
        try:
            message = decode_aoe(received.data)
            if not isinstance(message, Message) or message.command != Command.NOTIFICATION:
                return False
            samples = decode_notification(message.data)
        except DecodeError:
            return False  # counted as a dropped message
        for sample in samples:
            queue = self._queues.get((message.source.port, sample.handle))
            if queue is None:
                self._early.append((message.source.port, sample))
            else:
                queue.put(sample)
        return True

    def add(self, port: int, handle: int, kept: int) -> SampleQueue:
        """Add a queue. It receives the samples that arrived before the handle was known.

        Args:
            port: ADS port in the device.
            handle: Handle of the notification.
            kept: Number of samples that are stored.
        """
        queue = self._queues[port, handle] = SampleQueue(kept)
        for source, sample in self._early:
            if (source, sample.handle) == (port, handle):
                queue.put(sample)
        self._early.clear()
        return queue

    def remove(self, port: int, handle: int) -> None:
        """Remove a queue. Further samples of the handle are dropped."""
        self._queues.pop((port, handle), None)


class SampleQueue:
    """Bounded queue of samples. It counts the dropped ones."""

    def __init__(self, kept: int) -> None:
        self.samples: deque[Sample] = deque(maxlen=kept)
        self.dropped = 0

    def put(self, sample: Sample) -> None:
        """Store a sample, and drop the oldest one if the queue is full."""
        self.dropped += len(self.samples) == self.samples.maxlen
        self.samples.append(sample)


class AdsNotifications:
    """Samples of one value, which the device sends on its own.

    While a loop runs, samples arrive in the background, and `take` returns them. Without a loop,
    only `wait` and other requests read the mailbox.
    """

    def __init__(
        self,
        queues: NotificationQueues,
        channel: MailboxChannel,
        main: Conversations,
        peer: AdsPeer,
        handle: int,
        *,
        port: int,
        kept: int,
    ) -> None:
        self.handle = handle  # handle of the device
        self._queues = queues
        self._queue = queues.add(port, handle, kept)
        self._channel, self._main, self._peer, self._port = channel, main, peer, port
        self._open = True

    @property
    def dropped(self) -> int:
        """Number of samples that were dropped because the queue was full."""
        return self._queue.dropped

    def take(self) -> list[Sample]:
        """Return and remove the stored samples, oldest first. Does not wait."""
        samples = self._queue.samples
        return [samples.popleft() for _ in range(len(samples))]

    def wait(self, timeout: float = 1.0) -> list[Sample]:
        """Wait for a sample, and return all stored ones; an empty list after the timeout.

        Args:
            timeout: Longest time to wait [s].

        Raises:
            MailboxError: The device sent an invalid message.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        self._main.converse(await_delivery(self._channel, self._queue.samples, timeout))
        return self.take()

    def close(self) -> None:
        """End the notifications. A no-op if they have ended.

        A device that was restarted does not know the handle. This is not an error.
        """
        if not self._open:
            return
        self._open = False
        self._queues.remove(self._port, self.handle)
        with suppress(AdsError):
            self._main.converse(self._delete())

    def _delete(self) -> Procedure[bytes]:
        return request(self._channel, self._peer, DeleteNotification(self.handle), self._port)

    def __enter__(self) -> AdsNotifications:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.close()
