"""The mailbox of one SubDevice, ETG.1000.4 §5.6 and §6.7, ETG.1000.6 §5.1.

One message is outstanding at a time, and whole transfers take turns (`exclusively`). What the
network loses is recovered by the standard's own means, never by blindly sending the datagram again,
which jams mailboxes (SOEM#684):

- A lost read: toggle the repeat request of SyncManager 1, wait for the acknowledge, read again.
- A lost write: it is unknown whether it arrived. An answer within a grace period shows that it did.
  Otherwise write the message again with the same counter: the device recognises the repetition.

The counter of what the device sends only identifies repetitions. Devices may start it anywhere,
leave it 0 (ethercrab#236) or at another value, or copy ours (KickCAT, CoE/mailbox/response.cc). So
a message is dropped only if a repetition was requested, and the message equals the last accepted
one in every byte. SOEM (ecx_mbxreceive) and IgH (fsm_coe.c) compare no counter on reception.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from catenary.errors import DecodeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import (
    Procedure,
    Reply,
    Request,
    after,
    read,
    read_memory,
    write,
    write_memory,
)
from catenary.procedure.mailbox_channel import Heard as Heard
from catenary.procedure.mailbox_channel import MailboxChannel as MailboxChannel
from catenary.procedure.station import Deadline, Pace, answered
from catenary.wire import coe
from catenary.wire.datagram import EcatCommand
from catenary.wire.mailbox import Mailbox, Type, decode_error, decode_mailbox, next_counter
from catenary.wire.register import (
    sync_manager_activation,
    sync_manager_pdi_control,
    sync_manager_status,
)
from catenary.wire.sync_manager import Activation, PdiControl, Status

T = TypeVar("T")

OUT, IN = 0, 1  # SyncManagers of the mailbox, by the standard
WRITE_TIMEOUT = 1.0  # [s] until the device has emptied its mailbox
READ_TIMEOUT = 2.0  # [s] until it answers; AKDs take their time over 0x1010
REPEAT_TIMEOUT = 0.2  # [s] until it acknowledges a repeat request
EAGER_MAX = 256  # bytes of a mailbox that is read without a look before
LOOK = 100e-6  # [s] between the first two looks whether it has answered
TURN = 0.5e-3  # [s] between two looks whether the mailbox is free
GRACE = 0.1  # [s] for an answer to a message whose frame was lost
RECOVERIES = 5  # of one message, then the cable is to blame
STRANGERS = 64  # messages in a row that nobody can use; queues of devices are shorter


def exclusively(channel: MailboxChannel, conversation: Procedure[T]) -> Procedure[T]:
    """The conversation, once nobody else talks to this device: whoever runs it, transfers never
    mix, and take place in the order they were begun. The wait ends, because every conversation
    does."""
    ticket = object()
    channel.turns.append(ticket)
    try:
        while channel.turns[0] is not ticket:
            yield after(TURN)
        return (yield from conversation)
    finally:
        channel.turns.remove(ticket)


def converse(
    channel: MailboxChannel,
    kind: Type,
    data: bytes,
    accept: Callable[[Mailbox], T | None],
    *,
    timeout: float = READ_TIMEOUT,
) -> Procedure[T]:
    """Sends one message and returns what `accept` makes of the answer. `accept` returns None for
    a message that is none (a late answer to something else)."""
    if channel.owed:
        channel.posted_ns = None
        yield from _settle(channel)
    channel.counter = next_counter(channel.counter)
    message = Mailbox(kind, data, channel.counter).encode(channel.layout.receive_size)
    channel.owed, channel.emptied = True, False
    for _ in range(RECOVERIES):
        sent, stale = yield from _post(channel, message)
        if sent and not stale:
            channel.repetitions = 0  # the mailbox was empty: none of them is still to come
        if sent and channel.thinks_ns:
            yield after(channel.thinks_ns * 1e-9)
        if stale and (older := (yield from _take(channel))) is not None:
            _put_aside(channel, older)
        before = channel.dropped
        answer = yield from _await(channel, accept, Deadline(timeout if sent else GRACE))
        if answer is not None:
            return answer
        if sent:
            raise _no_answer(channel, kind, timeout, channel.dropped - before)
    raise ResponseTimeout(
        f"{channel.station}: {RECOVERIES} frames with the same mailbox message were lost",
        hint="look at the cable: the error counters at 0x0300 tell which",
    )


def further(
    channel: MailboxChannel, accept: Callable[[Mailbox], T | None], *, timeout: float = READ_TIMEOUT
) -> Procedure[T]:
    """The next part of an answer that comes in several messages."""
    channel.owed = True
    before = channel.dropped
    answer = yield from _await(channel, accept, Deadline(timeout))
    if answer is None:
        raise _no_answer(channel, Type.COE, timeout, channel.dropped - before)
    return answer


def _await(
    channel: MailboxChannel, accept: Callable[[Mailbox], T | None], deadline: Deadline
) -> Procedure[T | None]:
    """What `accept` takes of the messages that come until the deadline."""
    for _ in range(STRANGERS):
        received = yield from _fetch(channel, deadline)
        if received is None:
            return None
        channel.owed = False  # also where it is an error, or cannot be read
        answer = _sorted(channel, received, accept)
        if answer is not None:
            return answer
        channel.owed = True
    raise MailboxError(
        f"{channel.station} sends one message after the other that nobody asked for",
        hint="its firmware is at fault, or two masters talk to it",
    )


def _no_answer(
    channel: MailboxChannel, kind: Type, timeout: float, strangers: int
) -> ResponseTimeout:
    instead = f"; {strangers} messages of another kind instead" if strangers else ""
    return ResponseTimeout(
        f"{channel.station}: no answer to a {kind.name} message within {timeout:g} s{instead}",
        hint="its firmware is at fault, or two masters talk to it"
        if strangers
        else "the device's application may hang: read its state; power-cycle it",
    )


def tell(channel: MailboxChannel, kind: Type, data: bytes) -> Procedure[bool]:
    """Sends one message that has no answer. False: its frame was lost, it may have arrived."""
    channel.counter = next_counter(channel.counter)
    message = Mailbox(kind, data, channel.counter).encode(channel.layout.receive_size)
    return (yield from _post(channel, message))[0]


def drain(channel: MailboxChannel, accept: Callable[[Mailbox], T | None]) -> Procedure[list[T]]:
    """Reads what lies in the mailbox without asking for anything: late answers, emergencies."""
    found: list[T] = []
    for _ in range(STRANGERS):  # who sends on and on is heard again later
        if not (yield from _is_full(channel, IN))[0]:
            break
        received = yield from _take(channel)
        answer = _sorted(channel, received, accept) if received is not None else None
        if answer is not None:
            found.append(answer)
    return found


def _post(channel: MailboxChannel, message: bytes) -> Procedure[tuple[bool, bool]]:
    """Writes the message once the mailbox is empty: (whether its frame came back, whether an older
    message of the device waited then). SOEM looks for one too before it sends, in a frame of its
    own (ec_main.c); without that a device that answers twice would be one answer behind for good.
    """
    deadline, pace = Deadline(WRITE_TIMEOUT), Pace()
    station, layout = channel.station.address, channel.layout
    look = read(EcatCommand.FPRD, station, sync_manager_status(IN))._replace(repeatable=False)
    while True:
        request = write_memory(station, layout.receive_offset, message, repeatable=False)
        seen, reply = yield [look, request]
        if reply.lost:
            return False, False
        if reply.working_counter:
            answered(reply, channel.station, "mailbox write")
            channel.posted_ns = reply.time_ns
            waiting = seen.working_counter == 1 and bool(seen.data[0] & Status.MAILBOX_FULL)
            return True, waiting
        full, status = yield from _is_full(channel, OUT)
        if deadline.passed(status):
            raise _stuck(channel, full)
        yield after(pace.pause())


def _settle(channel: MailboxChannel) -> Procedure[None]:
    """Gives a late answer its last chance: it is not the next question's."""
    received = yield from _fetch(channel, Deadline(GRACE))
    if received is not None:
        _put_aside(channel, received)


def _put_aside(channel: MailboxChannel, message: Mailbox) -> None:
    """A message that nobody waits for any more; an emergency is heard."""
    emergency = _emergency(message)
    if emergency is not None:
        channel.hear(emergency)
    else:
        channel.dropped += 1


def _stuck(channel: MailboxChannel, full: bool) -> MailboxError:
    if full:
        return MailboxError(
            f"{channel.station} has not read its mailbox for {WRITE_TIMEOUT:g} s",
            hint="its application hangs, or waits for its own mailbox to be read: power-cycle it",
        )
    return MailboxError(
        f"{channel.station} does not take mailbox messages at "
        f"0x{channel.layout.receive_offset:04X} (working counter 0)",
        hint="its SyncManager 0 is off: bring it to PRE-OP again",
    )


def _fetch(channel: MailboxChannel, deadline: Deadline) -> Procedure[Mailbox | None]:
    """The next message the device sends; None when the deadline has passed."""
    pace = Pace(max(LOOK, channel.thinks_ns * 1e-10))  # a tenth
    empty_ns: int | None = None
    while True:
        there, received, time_ns = yield from _look(channel)
        if there:
            channel.learn(empty_ns)
        if received is not None:
            return received
        if channel.emptied:
            raise MailboxError(
                f"{channel.station} was brought up anew before it answered",
                hint="ask again",
            )
        if deadline.passed_at(time_ns):
            return None
        empty_ns = time_ns
        yield after(pace.pause())


def _look(channel: MailboxChannel) -> Procedure[tuple[bool, Mailbox | None, int]]:
    """Return (True if there was a message, the message unless it was a repetition, time [ns]).

    A small mailbox is read in the same frame that looks: an empty one is not changed by it, and
    answers with a working counter of 0. This is done only where counters identify repetitions: if
    the frame is lost, it is unknown whether it took a message. The mailbox is then read as it is.
    Only if nothing arrives within a grace period is the device asked to repeat its last message,
    because some stacks cannot repeat.
    """
    careful = not channel.counts or channel.layout.send_size > EAGER_MAX
    if careful or channel.unsure_ns is not None:
        return (yield from _look_first(channel))
    station = channel.station
    look = read(EcatCommand.FPRD, station.address, sync_manager_status(IN))._replace(
        repeatable=False
    )
    status, reply = yield [look, _read_request(channel)]
    if reply.lost:
        channel.unsure_ns = reply.time_ns
        return False, None, reply.time_ns
    answered(status, station, "mailbox status")
    if not reply.working_counter:
        return False, None, reply.time_ns
    channel.received_ns = reply.time_ns
    return True, _decoded(channel, reply.data), reply.time_ns


def _look_first(channel: MailboxChannel) -> Procedure[tuple[bool, Mailbox | None, int]]:
    """The same, where a full mailbox is read in a frame of its own."""
    full, status = yield from _is_full(channel, IN)
    unsure_ns = channel.unsure_ns
    if not full and unsure_ns is not None and status.time_ns - unsure_ns > GRACE * 1e9:
        full = yield from _ask_again(channel)
        channel.unsure_ns = None
    if not full:
        return False, None, status.time_ns
    channel.unsure_ns = None
    return True, (yield from _take(channel)), status.time_ns


def _is_full(channel: MailboxChannel, number: int) -> Procedure[tuple[bool, Reply]]:
    register = sync_manager_status(number)
    [reply] = yield [read(EcatCommand.FPRD, channel.station.address, register)]
    status = Status(register.unpack(answered(reply, channel.station, "mailbox status")))
    return Status.MAILBOX_FULL in status, reply


def _read_request(channel: MailboxChannel) -> Request:
    layout = channel.layout
    return read_memory(
        channel.station.address, layout.send_offset, layout.send_size, repeatable=False
    )


def _take(channel: MailboxChannel) -> Procedure[Mailbox | None]:
    """Read the full mailbox. Return None for a repetition of what was read before, or nothing."""
    for _ in range(RECOVERIES):
        [reply] = yield [_read_request(channel)]
        if not reply.lost:
            channel.received_ns = reply.time_ns
            return _decoded(channel, reply.data) if reply.working_counter else None
        if not (yield from _ask_again(channel)):
            return None
    raise ResponseTimeout(
        f"{channel.station}: {RECOVERIES} frames that read its mailbox were lost",
        hint="look at the cable: the error counters at 0x0300 tell which",
    )


def _decoded(channel: MailboxChannel, data: bytes) -> Mailbox | None:
    try:
        message = decode_mailbox(data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: a mailbox message that is none: {error}",
            hint="its firmware is at fault; a capture of the bring-up shows the bytes",
        ) from error
    return message if channel.accept(message) else None


def _ask_again(channel: MailboxChannel) -> Procedure[bool]:
    """Repeat request and acknowledge of SyncManager 1, ETG.1000.4 §6.7.2: the device puts its
    last message into the buffer once more. Whether there is one now."""
    channel.repeat_requested = not channel.repeat_requested
    channel.repetitions += 1
    activation = Activation.ENABLE
    if channel.repeat_requested:
        activation |= Activation.REPEAT_REQUEST
    register, answer = sync_manager_activation(IN), sync_manager_pdi_control(IN)
    station = channel.station
    [reply] = yield [write(EcatCommand.FPWR, station.address, register, int(activation))]
    answered(reply, station, "mailbox repeat request")
    deadline, pace = Deadline(REPEAT_TIMEOUT), Pace()
    while True:
        [reply] = yield [read(EcatCommand.FPRD, station.address, answer)]
        value = PdiControl(answer.unpack(answered(reply, station, "mailbox repeat acknowledge")))
        acknowledged = (PdiControl.REPEAT_ACKNOWLEDGE in value) == channel.repeat_requested
        if acknowledged and (yield from _is_full(channel, IN))[0]:
            return True
        if deadline.passed(reply):
            break
        yield after(pace.pause())
    if acknowledged:
        return False
    raise MailboxError(
        f"{station} does not acknowledge the repeat request of its mailbox",
        hint="its stack lacks the recovery of ETG.1000.4 §6.7.2: bring it to INIT and back",
    )


def _sorted(
    channel: MailboxChannel, message: Mailbox, accept: Callable[[Mailbox], T | None]
) -> T | None:
    if message.type is Type.ERROR:
        raise _error_reply(channel, message)
    emergency = _emergency(message)
    if emergency is not None:
        channel.hear(emergency)
        return None
    answer = accept(message)
    if answer is None:
        channel.dropped += 1
    return answer


def _error_reply(channel: MailboxChannel, message: Mailbox) -> MailboxError:
    """Return the error for a mailbox error reply, also for a malformed one."""
    try:
        reply = decode_error(message.data)
        what = f"0x{reply.code:04X}: {reply.text}"
    except DecodeError as error:
        what = f"without a valid code ({error.message})"
    return MailboxError(
        f"{channel.station} answers with mailbox error {what}",
        hint="the device does not offer this mailbox service",
    )


def _emergency(message: Mailbox) -> coe.Emergency | None:
    header = int.from_bytes(message.data[: coe.HEADER_SIZE], "little")
    if message.type is not Type.COE or header >> 12 != coe.Service.EMERGENCY:
        return None
    try:
        decoded = coe.decode_coe(message.data)
    except DecodeError:
        return None  # cut short: dropped and counted like anything nobody can use
    return decoded if isinstance(decoded, coe.Emergency) else None
