"""State of one SubDevice's mailbox between two messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from catenary.model.device import MailboxLayout
from catenary.procedure.station import Station
from catenary.wire import coe
from catenary.wire.mailbox import Mailbox, Type

EMERGENCIES_KEPT = 64
ANSWER_DELAY_FIRST_NS = 100_000
ANSWER_DELAY_MAX_NS = 20_000_000


class ReceivedEmergency(NamedTuple):
    """An emergency and the time at which it was read [ns, the link's clock]."""

    emergency: coe.Emergency
    time_ns: int


Listener: TypeAlias = Callable[[ReceivedEmergency], None]
# Receives a message and the time at which it was read [ns]. It returns True if it used the message.
Subscriber: TypeAlias = Callable[[Mailbox, int], bool]


@dataclass(slots=True)
class MailboxChannel:
    """State of one SubDevice's mailbox: counters, repetitions, emergencies.

    Emergencies arrive between the answers to requests. `listener` is called for each of them, in
    any procedure. `listen` also reports those that arrived before there was a listener.
    """

    station: Station
    layout: MailboxLayout
    counter: int = 0  # of the last written message
    received: Mailbox | None = None  # last accepted message
    counts: bool = False  # the last counter differed from the previous one and from 0
    repetitions: int = 0  # repetitions requested from the device, but not yet read
    received_ns: int = 0  # time at which the last message was read
    emergencies: deque[ReceivedEmergency] = field(
        default_factory=lambda: deque(maxlen=EMERGENCIES_KEPT)
    )
    listener: Listener | None = None
    # Receivers of messages that no procedure expects, by protocol, for example Ethernet frames.
    subscribers: dict[Type, Subscriber] = field(default_factory=dict)
    dropped: int = 0  # unexpected messages and duplicates
    lost_reads: int = 0  # lost frames that read the mailbox; each may have lost a message
    lost_writes: int = 0  # lost frames that wrote the mailbox; each message may have arrived
    # Active and waiting procedures; the first one uses the mailbox.
    turns: deque[object] = field(default_factory=deque)
    posted_ns: int | None = None  # time of the last request, until its answer arrives
    answer_delay_ns: int = 0  # expected time until the device answers
    punctual: bool = False  # the last answer was there at the first poll
    unsure_ns: int | None = None  # time of a lost frame that may have emptied the mailbox
    owed: bool = False  # an answer may still arrive: a request is pending or has timed out
    undescribed: int = 0  # number of missing or malformed SDO information answers in a row
    resets: int = 0  # number of times that the SyncManagers were configured again
    emptied: bool = False  # configured again since the request, so no answer will arrive

    def reset(self) -> None:
        """Reset the state after the SyncManagers were configured again."""
        self.counter = self.repetitions = 0
        self.received = None
        self.counts = self.owed = False
        self.unsure_ns = None
        self.resets += 1
        self.emptied = True

    def accept(self, message: Mailbox) -> bool:
        """Accept a message. Return False if it is a repetition of the last accepted one.

        An equal message is a repetition only if one was requested: a device with a constant counter
        sends equal answers to equal requests.
        """
        expected, self.repetitions = self.repetitions > 0, max(self.repetitions - 1, 0)
        if expected and message == self.received:
            self.dropped += 1
            return False
        before = self.received.counter if self.received is not None else 0
        self.received, self.counts = message, message.counter not in (0, before)
        return True

    def learn(self, empty_ns: int | None) -> None:
        """Adapt the time of the first poll to the time that the last answer took.

        A device usually takes the same time again, and each poll costs a frame.

        Args:
            empty_ns: Time of the last poll without an answer; None if the first poll succeeded.
        """
        self.punctual = empty_ns is None
        if empty_ns is None:
            self.answer_delay_ns = self.answer_delay_ns * 31 // 32
        elif self.posted_ns is not None:
            # A single slow answer must not delay all further polls.
            limit_ns = max(2 * self.answer_delay_ns, ANSWER_DELAY_FIRST_NS)
            self.answer_delay_ns = min(empty_ns - self.posted_ns, limit_ns, ANSWER_DELAY_MAX_NS)
        self.posted_ns = None

    def listen(self, listener: Listener) -> None:
        """Set the listener. The first listener also receives earlier emergencies."""
        if self.listener is None:
            for received in tuple(self.emergencies):
                listener(received)
        self.listener = listener

    def deliver(self, message: Mailbox) -> bool:
        """Give an unexpected message to the subscriber of its protocol.

        Args:
            message: The message.

        Returns:
            True if a subscriber used the message.
        """
        subscriber = self.subscribers.get(message.type)
        return subscriber is not None and subscriber(message, self.received_ns)

    def add_emergency(self, emergency: coe.Emergency) -> None:
        """Store an emergency and report it to the listener."""
        received = ReceivedEmergency(emergency, self.received_ns)
        self.emergencies.append(received)
        if self.listener is not None:
            self.listener(received)
