"""MailboxChannel: what must be remembered of one SubDevice's mailbox between two messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from catenary.model.device import MailboxLayout
from catenary.procedure.station import Station
from catenary.wire import coe
from catenary.wire.mailbox import Mailbox

EMERGENCIES_KEPT = 64
THINKS_FIRST_NS = 100_000
THINKS_MAX_NS = 20_000_000


class Heard(NamedTuple):
    """An emergency and when it was read [ns, the link's clock]."""

    emergency: coe.Emergency
    time_ns: int


Listener: TypeAlias = Callable[[Heard], None]


@dataclass(slots=True)
class MailboxChannel:
    """Owns the state of one SubDevice's mailbox: counters, repeat toggle, emergencies.

    Emergencies come between the answers to anybody's questions: `listener` is told of each, whoever
    read it; those of before there was one are told by `listen`.
    """

    station: Station
    layout: MailboxLayout
    counter: int = 0  # of what was written last
    received: Mailbox | None = None  # message that was accepted last
    counts: bool = False  # its counter differed from that of the message before, and from 0
    repetitions: int = 0  # requested from the device, and not read yet
    received_ns: int = 0  # when that was
    repeat_requested: bool = False  # state of the toggle bit
    emergencies: deque[Heard] = field(default_factory=lambda: deque(maxlen=EMERGENCIES_KEPT))
    listener: Listener | None = None
    dropped: int = 0  # messages nobody waited for, duplicates
    turns: deque[object] = field(default_factory=deque)  # conversations: the first one holds it
    posted_ns: int | None = None  # when it was asked last, until the answer is there
    thinks_ns: int = 0  # the device, before it answers, at least
    unsure_ns: int | None = None  # when a frame was lost that may have taken a message
    owed: bool = False  # a question was given up; its answer may still come
    undescribed: int = 0  # answers of SDO information in a row that were missing or malformed
    emptied: bool = False  # configured anew since the question was asked: nobody will answer it

    def reset(self) -> None:
        """After the SyncManagers were configured anew."""
        self.counter = self.repetitions = 0
        self.received = None
        self.counts = self.repeat_requested = self.owed = False
        self.unsure_ns = None
        self.emptied = True

    def accept(self, message: Mailbox) -> bool:
        """Return False for a repetition of the last accepted message, else accept this one.

        An equal message is a repetition only if one was requested: a device whose counter does not
        change sends equal answers to equal questions.
        """
        expected, self.repetitions = self.repetitions > 0, max(self.repetitions - 1, 0)
        if expected and message == self.received:
            self.dropped += 1
            return False
        before = self.received.counter if self.received is not None else 0
        self.received, self.counts = message, message.counter not in (0, before)
        return True

    def learn(self, empty_ns: int | None) -> None:
        """An answer is there; at `empty_ns` it was not yet (None: nobody had looked). Nobody looks
        much earlier the next time: a device takes as long again, and looks cost frames."""
        if empty_ns is None:
            self.thinks_ns = self.thinks_ns * 9 // 10
        elif self.posted_ns is not None:
            more = max(2 * self.thinks_ns, THINKS_FIRST_NS)  # one that was slow once is not slow
            self.thinks_ns = min(empty_ns - self.posted_ns, more, THINKS_MAX_NS)
        self.posted_ns = None

    def listen(self, listener: Listener) -> None:
        """From now on; what was heard before is told at once."""
        if self.listener is None:
            for heard in tuple(self.emergencies):
                listener(heard)
        self.listener = listener

    def hear(self, emergency: coe.Emergency) -> None:
        """An emergency was read."""
        heard = Heard(emergency, self.received_ns)
        self.emergencies.append(heard)
        if self.listener is not None:
            self.listener(heard)
