"""Exchange of mailbox messages that need no answer, in both directions at once.

`swap` sends one message and receives one, in a single exchange if possible. `converse` of
`procedure/mailbox.py` is for requests and their answers. The rules for lost frames are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from catenary.errors import MailboxError
from catenary.procedure import mailbox as box
from catenary.procedure.exchange import Procedure, Reply, read, write_memory
from catenary.procedure.mailbox_channel import MailboxChannel
from catenary.procedure.station import Deadline, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.mailbox import Mailbox, Type, next_counter
from catenary.wire.register import sync_manager_status
from catenary.wire.sync_manager import Status

LOSSES_MAX = 5  # lost frames with one message


@dataclass(slots=True, eq=False)
class Outgoing:
    """One message to send, with the state of its attempts."""

    kind: Type
    data: bytes
    encoded: bytes = b""  # with its counter, from the first attempt on
    counter: int = 0
    losses: int = 0
    deadline: Deadline | None = None

    @property
    def given_up(self) -> bool:
        """True if too many frames with this message were lost."""
        return self.losses >= LOSSES_MAX


class Swapped(NamedTuple):
    """Result of one exchange."""

    sent: bool
    received: bool


def swap(
    channel: MailboxChannel, outgoing: Outgoing | None, *, expected: bool
) -> Procedure[Swapped]:
    """Write a message if the mailbox is empty, and read one if there is one.

    Args:
        channel: The mailbox of the device. The subscriber of its protocol gets a received message.
        outgoing: Message to send; None to only receive.
        expected: True if a message is probable: it is then read without checking first.

    Raises:
        ResponseTimeout: The device does not answer.
        MailboxError: The device does not read its mailbox, or answers with a mailbox error.
    """
    if channel.unsure_ns is not None:  # a lost frame may have emptied the mailbox
        _, message, _ = yield from box.poll(channel)
        _give(channel, message)
        return Swapped(False, message is not None)
    eager = channel.counts and (expected or channel.layout.send_size <= box.EAGER_MAX)
    station, layout = channel.station, channel.layout
    status = sync_manager_status(box.IN)
    requests = [read(EcatCommand.FPRD, station.address, status)._replace(repeatable=False)]
    if outgoing is not None:
        data = _encoded(channel, outgoing)
        requests.append(
            write_memory(station.address, layout.receive_offset, data, repeatable=False)
        )
    if eager:
        requests.append(box.read_request(channel))
    replies = yield requests
    seen, read_eagerly = replies[0], eager and bool(replies[-1].lost or replies[-1].working_counter)
    # The read comes first: an error of the write must not hide a lost read.
    received = read_eagerly and _take_eager(channel, replies[-1])
    sent = outgoing is not None and _note_sent(channel, outgoing, replies[1])
    if read_eagerly:
        return Swapped(sent, received)
    full = not seen.lost and bool(
        answered(seen, station, "mailbox status")[0] & Status.MAILBOX_FULL
    )
    message = (yield from box.take(channel)) if full else None
    _give(channel, message)
    return Swapped(sent, message is not None)


def _encoded(channel: MailboxChannel, outgoing: Outgoing) -> bytes:
    """Return the bytes of a message. A repetition has the same counter.

    If another procedure has used the mailbox since the last attempt, the message gets a new counter
    and a new deadline. The device compares counters only with that of the previous message.
    """
    if not outgoing.encoded or outgoing.counter != channel.counter:
        channel.counter = outgoing.counter = next_counter(channel.counter)
        message = Mailbox(outgoing.kind, outgoing.data, channel.counter)
        outgoing.encoded = message.encode(channel.layout.receive_size)
        outgoing.deadline = Deadline(_patience(channel))
    return outgoing.encoded


def _patience(channel: MailboxChannel) -> float:
    """Return the time in which the device has to read its mailbox [s]."""
    return max(box.WRITE_TIMEOUT, channel.station.timeouts.mailbox_request or 0.0)


def _note_sent(channel: MailboxChannel, outgoing: Outgoing, reply: Reply) -> bool:
    if reply.lost:
        outgoing.losses += 1
        return False
    if reply.working_counter:
        answered(reply, channel.station, "mailbox write")
        return True
    if outgoing.deadline is not None and outgoing.deadline.passed(reply):
        raise MailboxError(
            f"{channel.station} has not read its mailbox for {_patience(channel):g} s",
            hint="its application hangs, or its mailbox is disabled: bring it to PRE-OP again",
        )
    return False


def _take_eager(channel: MailboxChannel, reply: Reply) -> bool:
    if reply.lost:
        channel.unsure_ns = reply.time_ns
        return False
    channel.received_ns = reply.time_ns
    message = box.decoded(channel, reply.data)
    _give(channel, message)
    return message is not None


def _give(channel: MailboxChannel, message: Mailbox | None) -> None:
    """Give a message to its receiver. Raises MailboxError if it is a mailbox error."""
    if message is not None:
        box.accepted(channel, message, lambda _: None)
