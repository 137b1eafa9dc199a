"""Notifications of an ADS device: values that it sends on its own."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType

from catenary.bus.sdo import MailboxOwner
from catenary.errors import AdsError, DecodeError, MailboxError
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
    """Queues of the samples of one device, by port and handle.

    Procedures and the subscriber of the mailbox run in one thread. They alone add samples.
    """

    def __init__(self) -> None:
        self._queues: dict[tuple[int, int], SampleQueue] = {}
        self._opening = 0  # requests without an answer
        self._early: deque[tuple[int, Sample]] = deque(maxlen=EARLY_KEPT)

    def listen(self, channel: MailboxChannel) -> None:
        """Receive the notifications of a mailbox."""
        channel.subscribers[Type.AOE] = self.take

    def take(self, received: Mailbox, _time_ns: int) -> bool:
        """Store the samples of a message. Return True if a queue exists for one of them."""
        try:
            message = decode_aoe(received.data)
            if not isinstance(message, Message) or message.command != Command.NOTIFICATION:
                return False
            samples = decode_notification(message.data)
        except DecodeError:
            return False  # counted as a dropped message
        used = [self._store(message.source.port, sample) for sample in samples]
        return any(used)

    def _store(self, port: int, sample: Sample) -> bool:
        queue = self._queues.get((port, sample.handle))
        if queue is not None:
            queue.put(sample)
        elif self._opening:
            self._early.append((port, sample))
        return queue is not None or self._opening > 0

    def opened(self, handle: Procedure[int], port: int, kept: int) -> Procedure[SampleQueue]:
        """Request a notification, and return its queue.

        The queue receives the samples that arrived before the handle was known.

        Args:
            handle: Procedure that requests the notification and returns its handle.
            port: ADS port in the device.
            kept: Number of samples that are stored.
        """
        self._opening += 1
        try:
            queue = SampleQueue(port, (yield from handle), kept)
            self._queues[port, queue.handle] = queue
            for source, sample in self._early:
                if (source, sample.handle) == (port, queue.handle):
                    queue.put(sample)
            return queue
        finally:
            self._opening -= 1
            if not self._opening:
                self._early.clear()

    def remove(self, queue: SampleQueue) -> None:
        """Remove a queue. Further samples of its handle are dropped."""
        if self._queues.get((queue.port, queue.handle)) is queue:
            del self._queues[queue.port, queue.handle]


class SampleQueue:
    """Bounded queue of the samples of one handle. It counts the dropped ones."""

    def __init__(self, port: int, handle: int, kept: int) -> None:
        self.port, self.handle = port, handle
        self.samples: deque[Sample] = deque(maxlen=kept)
        self.dropped = 0

    def put(self, sample: Sample) -> None:
        """Store a sample, and drop the oldest one if the queue is full."""
        self.dropped += len(self.samples) == self.samples.maxlen
        self.samples.append(sample)


@dataclass(frozen=True, slots=True)
class NotificationSource:
    """Device that sends notifications, and the queues of its samples."""

    sub: MailboxOwner
    channel: MailboxChannel  # when the notifications were requested
    peer: AdsPeer
    queues: NotificationQueues


class AdsNotifications:
    """Samples of one value, which the device sends on its own.

    While a loop runs, samples arrive in the background, and `take` returns them. Without a loop,
    only `wait` and other requests read the mailbox. A device ends its notifications in INIT.
    """

    def __init__(self, source: NotificationSource, queue: SampleQueue) -> None:
        self._source, self._queue = source, queue
        self._resets = source.channel.resets
        self._open = True

    @property
    def handle(self) -> int:
        """Handle of the device."""
        return self._queue.handle

    @property
    def ended(self) -> bool:
        """True after `close`, and if the device was in INIT or scanned since: subscribe again."""
        channel = self._source.channel
        replaced = channel is not self._source.sub.channel or channel.resets != self._resets
        return replaced or not self._open

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
            MailboxError: The notifications have ended, or the device sent an invalid message.
            RuntimeError: The caller is the iterating thread of a loop.
            ValueError: The timeout is negative or infinite.
        """
        source, samples = self._source, self._queue.samples
        if not samples and self.ended:
            raise MailboxError(
                f"{source.channel.station}: the notifications of handle {self.handle} have ended",
                hint="they were closed, or the device was in INIT: subscribe again",
            )
        if not samples:
            source.sub.main.converse(await_delivery(source.channel, samples, timeout))
        return self.take()

    def close(self) -> None:
        """End the notifications. A no-op if they have ended. The samples stay available.

        Raises:
            MailboxError: The device violates the protocol, or does not answer.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        source, queue = self._source, self._queue
        if not self.ended:
            asked = DeleteNotification(queue.handle)
            with suppress(AdsError):  # a device that was restarted does not know the handle
                source.sub.main.converse(request(source.channel, source.peer, asked, queue.port))
        source.queues.remove(queue)
        self._open = False

    def __enter__(self) -> AdsNotifications:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self.close()
