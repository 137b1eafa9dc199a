"""Mailbox transfers of one SubDevice, ETG.1000.4 §5.6 and §6.7, ETG.1000.6 §5.1.

Only one message is outstanding at a time, and transfers run one after another (`exclusively`). Lost
messages are recovered as the standard specifies. A datagram is never simply sent again, because
that can block the mailbox (SOEM#684):

- After a lost read, the repeat request of SyncManager 1 is toggled. When the device has
  acknowledged it, the mailbox is read again.
- After a lost write, it is unknown whether the message arrived. An answer within a grace period
  shows that it did. Otherwise the message is written again with the same counter, so that the
  device recognises the repetition.

The counter in messages of the device only identifies repetitions. Devices may start it at any
value, leave it constant at 0 (ethercrab#236) or another value, or copy the counter of the request
(KickCAT, CoE/mailbox/response.cc). A message is therefore dropped only if a repetition was
requested and the message equals the last accepted one in every byte. SOEM (ecx_mbxreceive) and IgH
(fsm_coe.c) do not compare the counter on reception.
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
from catenary.procedure.mailbox_channel import MailboxChannel as MailboxChannel
from catenary.procedure.mailbox_channel import ReceivedEmergency as ReceivedEmergency
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

OUT, IN = 0, 1  # SyncManagers of the mailbox, as defined by the standard
WRITE_TIMEOUT = 1.0  # [s] until the device has emptied its mailbox
READ_TIMEOUT = 2.0  # [s] until it answers; AKD drives take long for 0x1010
REPEAT_TIMEOUT = 0.2  # [s] until it acknowledges a repeat request
EAGER_MAX = 256  # [bytes]; a larger mailbox is read after a status check, or if it should be full
POLL = 100e-6  # [s] between the first two polls for an answer
POLL_SOON = 20e-6  # [s] the same, if the last answer was there at the first poll
TURN = 0.5e-3  # [s] between two checks for a free mailbox
GRACE = 0.1  # [s] for an answer to a message whose frame was lost
RECOVERIES = 5  # attempts per message; then the cable is assumed to be faulty
UNEXPECTED_MAX = 64  # unexpected messages in a row; the queues of devices are shorter


def exclusively(channel: MailboxChannel, procedure: Procedure[T]) -> Procedure[T]:
    """Wait until no other procedure uses this mailbox, then run a procedure.

    Procedures are never interleaved. They run in the order in which they were started.

    Args:
        channel: The mailbox of the device.
        procedure: The procedure to run.
    """
    ticket = object()
    channel.turns.append(ticket)
    try:
        while channel.turns[0] is not ticket:
            yield after(TURN)
        return (yield from procedure)
    finally:
        channel.turns.remove(ticket)


def turn_comes(channel: MailboxChannel, seconds: float) -> Procedure[bool]:
    """Wait for a turn in the queue of a mailbox. Return False if it does not come in time.

    Args:
        channel: The mailbox of the device.
        seconds: Longest time to wait [s].
    """
    ticket = object()
    channel.turns.append(ticket)
    try:
        return (yield from turn_comes_for(channel, ticket, seconds))
    finally:
        channel.turns.remove(ticket)


def turn_comes_for(channel: MailboxChannel, ticket: object, seconds: float) -> Procedure[bool]:
    """Wait until a ticket is the first in the queue of a mailbox. Return False if it is too late.

    Args:
        channel: The mailbox of the device.
        ticket: Element of `channel.turns`.
        seconds: Longest time to wait [s].
    """
    for _ in range(round(seconds / TURN)):
        if channel.turns[0] is ticket:
            return True
        yield after(TURN)
    return channel.turns[0] is ticket


def converse(
    channel: MailboxChannel,
    kind: Type,
    data: bytes,
    accept: Callable[[Mailbox], T | None],
    *,
    timeout: float = READ_TIMEOUT,
) -> Procedure[T]:
    """Send one message and return its answer, converted by `accept`.

    Args:
        channel: The mailbox of the device.
        kind: The protocol of the message.
        data: The data of the message.
        accept: Function that converts the answer. It returns None for any other message, such as
            a late answer to another request.
        timeout: Longest time until the answer arrives [s].

    Raises:
        ResponseTimeout: No answer within `timeout`, or too many frames were lost.
        MailboxError: The device violates the protocol, answers with a mailbox error, does not read
            its mailbox, or is restarted before it answers.
    """
    if channel.owed:
        channel.posted_ns = None
        yield from _settle(channel)
    channel.counter = next_counter(channel.counter)
    message = Mailbox(kind, data, channel.counter).encode(channel.layout.receive_size)
    patience = _patience(channel, timeout)
    channel.owed, channel.emptied = True, False
    for _ in range(RECOVERIES):
        sent, stale = yield from _post(channel, message)
        if sent and not stale:
            channel.repetitions = 0  # the mailbox was empty: no repetition is pending
        if sent and channel.answer_delay_ns:
            yield after(channel.answer_delay_ns * 1e-9)
        if stale and (older := (yield from take(channel))) is not None:
            _drop_late(channel, older)
        before = channel.dropped
        answer = yield from _await(channel, accept, Deadline(patience if sent else GRACE))
        if answer is not None:
            return answer
        if sent:
            raise _no_answer(channel, kind, patience, channel.dropped - before)
    raise ResponseTimeout(
        f"{channel.station}: {RECOVERIES} frames with the same mailbox message were lost",
        hint="check the cables: the error counters at 0x0300 show which one is faulty",
    )


def further(
    channel: MailboxChannel,
    accept: Callable[[Mailbox], T | None],
    *,
    timeout: float = READ_TIMEOUT,
    kind: Type = Type.COE,
) -> Procedure[T]:
    """Receive the next part of an answer that consists of several messages.

    Args:
        channel: The mailbox of the device.
        accept: Function that converts a message. It returns None for an unexpected message.
        timeout: Longest time until the part arrives [s].
        kind: The protocol of the message, for errors.

    Raises:
        ResponseTimeout: No answer within `timeout`, or too many frames were lost.
        MailboxError: As in `converse`.
    """
    channel.owed = True
    before, patience = channel.dropped, _patience(channel, timeout)
    answer = yield from _await(channel, accept, Deadline(patience))
    if answer is None:
        raise _no_answer(channel, kind, patience, channel.dropped - before)
    return answer


def _patience(channel: MailboxChannel, timeout: float) -> float:
    """Return the longer of a timeout and the response time that the device's ESI states [s]."""
    return max(timeout, channel.station.timeouts.mailbox_response or 0.0)


def _await(
    channel: MailboxChannel, accept: Callable[[Mailbox], T | None], deadline: Deadline
) -> Procedure[T | None]:
    """Return the first message that `accept` converts; None if none arrives by the deadline."""
    before = channel.dropped
    while channel.dropped - before < UNEXPECTED_MAX:
        received = yield from _fetch(channel, deadline)
        if received is None:
            return None
        channel.owed = False  # also if it is an error or cannot be decoded
        answer = accepted(channel, received, accept)
        if answer is not None:
            return answer
        channel.owed = True
        if deadline.passed_at(channel.received_ns):
            return None  # a device may send emergencies or Ethernet frames without end
    raise MailboxError(
        f"{channel.station} sent {UNEXPECTED_MAX} unexpected mailbox messages in a row",
        hint="its firmware is at fault, or a second master accesses it",
    )


def _no_answer(
    channel: MailboxChannel, kind: Type, timeout: float, unexpected: int
) -> ResponseTimeout:
    others = f"; {unexpected} other messages arrived" if unexpected else ""
    return ResponseTimeout(
        f"{channel.station}: no answer to a {kind.name} message within {timeout:g} s{others}",
        hint="its firmware is at fault, or a second master accesses it"
        if unexpected
        else "the application of the device may hang: read its state, then power-cycle it",
    )


def send_only(
    channel: MailboxChannel, kind: Type, data: bytes, *, attempts: int = 1
) -> Procedure[bool]:
    """Send one message that the device does not answer.

    Args:
        channel: The mailbox of the device.
        kind: The protocol of the message.
        data: The data of the message.
        attempts: Number of times that the message is sent while its frame is lost. The counter
            stays the same, so that the device recognises a repetition.

    Returns:
        False if the frame was lost. The device may still have received the message.

    Raises:
        MailboxError: The device does not read its mailbox.
    """
    channel.counter = next_counter(channel.counter)
    message = Mailbox(kind, data, channel.counter).encode(channel.layout.receive_size)
    for _ in range(attempts):
        if (yield from _post(channel, message))[0]:
            return True
    return False


def drain(channel: MailboxChannel, accept: Callable[[Mailbox], T | None]) -> Procedure[list[T]]:
    """Read the messages in the mailbox without sending a request: late answers, emergencies.

    At most `UNEXPECTED_MAX` messages are read.

    Args:
        channel: The mailbox of the device.
        accept: Function that converts a message. It returns None for an unexpected message.

    Returns:
        The converted messages. Emergencies are stored in the channel.

    Raises:
        MailboxError: A message is invalid or a mailbox error.
    """
    found: list[T] = []
    for _ in range(UNEXPECTED_MAX):  # a device may send without end; the rest is read later
        if not (yield from _is_full(channel, IN))[0]:
            break
        received = yield from take(channel)
        answer = accepted(channel, received, accept) if received is not None else None
        if answer is not None:
            found.append(answer)
    return found


def _post(channel: MailboxChannel, message: bytes) -> Procedure[tuple[bool, bool]]:
    """Write the message when the mailbox is empty.

    The read mailbox is checked in the same frame. Otherwise, after a device has answered twice,
    each request would receive the answer to the previous one. SOEM checks in a separate frame
    (ec_main.c).

    Returns:
        Two flags: True if the frame came back, and True if an older message of the device was
        waiting.
    """
    patience = max(WRITE_TIMEOUT, channel.station.timeouts.mailbox_request or 0.0)
    deadline, pace = Deadline(patience), Pace()
    station, layout = channel.station.address, channel.layout
    check = read(EcatCommand.FPRD, station, sync_manager_status(IN))._replace(repeatable=False)
    while True:
        request = write_memory(station, layout.receive_offset, message, repeatable=False)
        seen, reply = yield [check, request]
        if reply.lost:
            channel.lost_writes += 1
            return False, False
        if reply.working_counter:
            answered(reply, channel.station, "mailbox write")
            channel.posted_ns = reply.time_ns
            waiting = seen.working_counter == 1 and bool(seen.data[0] & Status.MAILBOX_FULL)
            return True, waiting
        full, status = yield from _is_full(channel, OUT)
        if deadline.passed(status):
            raise _stuck(channel, full, patience)
        yield after(pace.pause())


def _settle(channel: MailboxChannel) -> Procedure[None]:
    """Wait for a late answer and drop it, so that the next request does not receive it."""
    received = yield from _fetch(channel, Deadline(GRACE))
    if received is not None:
        _drop_late(channel, received)


def _drop_late(channel: MailboxChannel, message: Mailbox) -> None:
    """Drop a late message, but report an emergency, and give others to their subscribers."""
    emergency = _emergency(message)
    if emergency is not None:
        channel.add_emergency(emergency)
    elif not channel.deliver(message):
        channel.dropped += 1


def _stuck(channel: MailboxChannel, full: bool, patience: float) -> MailboxError:
    if full:
        return MailboxError(
            f"{channel.station} has not read its mailbox for {patience:g} s",
            hint="its application hangs, or waits until its send mailbox is read: power-cycle it",
        )
    return MailboxError(
        f"{channel.station} does not accept mailbox messages at "
        f"0x{channel.layout.receive_offset:04X} (working counter 0)",
        hint="its SyncManager 0 is disabled: bring it to PRE-OP again",
    )


def _fetch(channel: MailboxChannel, deadline: Deadline) -> Procedure[Mailbox | None]:
    """Wait for the next message of the device. Return None if the deadline has passed."""
    # A tenth of the expected time; less if the answer cannot be much later than the last one.
    first = POLL_SOON if channel.punctual else max(POLL, channel.answer_delay_ns * 1e-10)
    pace = Pace(first)
    empty_ns: int | None = None
    while True:
        arrived, received, time_ns = yield from poll(channel)
        if arrived:
            channel.learn(empty_ns)
        if received is not None:
            return received
        if channel.emptied:
            raise MailboxError(
                f"{channel.station} was restarted before it answered",
                hint="repeat the request",
            )
        if deadline.passed_at(time_ns):
            return None
        empty_ns = time_ns
        yield after(pace.pause())


def poll(channel: MailboxChannel) -> Procedure[tuple[bool, Mailbox | None, int]]:
    """Read the next message, if there is one.

    A small mailbox is read in the same frame as its status, if counters identify repetitions. So
    is a large one, if the last answer was there at the first poll: each packet of a file then takes
    two exchanges. The read has no effect on an empty mailbox, and returns a working counter of 0.

    If the frame is lost, the mailbox may have been emptied. Its status is then polled. A repetition
    is requested only if nothing arrives within a grace period, because some stacks cannot repeat a
    message.

    Returns:
        True if there was a message, the message, and the time [ns]. The message is None if there
        was none, or if it was a repetition.
    """
    empty = not channel.punctual and channel.layout.send_size > EAGER_MAX  # probably
    careful = not channel.counts or empty
    if careful or channel.unsure_ns is not None:
        return (yield from _poll_status_first(channel))
    station = channel.station
    check = read(EcatCommand.FPRD, station.address, sync_manager_status(IN))._replace(
        repeatable=False
    )
    status, reply = yield [check, read_request(channel)]
    if reply.lost:
        channel.lost_reads += 1
        channel.unsure_ns = reply.time_ns
        return False, None, reply.time_ns
    answered(status, station, "mailbox status")
    if not reply.working_counter:
        channel.punctual = False
        return False, None, reply.time_ns
    channel.received_ns = reply.time_ns
    return True, decoded(channel, reply.data), reply.time_ns


def _poll_status_first(channel: MailboxChannel) -> Procedure[tuple[bool, Mailbox | None, int]]:
    """Do the same as `poll`, but read a full mailbox in a separate frame."""
    full, status = yield from _is_full(channel, IN)
    unsure_ns = channel.unsure_ns
    if not full and unsure_ns is not None and status.time_ns - unsure_ns > GRACE * 1e9:
        full = yield from _request_repetition(channel)
        channel.unsure_ns = None
    if not full:
        return False, None, status.time_ns
    channel.unsure_ns = None
    return True, (yield from take(channel)), status.time_ns


def _is_full(channel: MailboxChannel, number: int) -> Procedure[tuple[bool, Reply]]:
    register = sync_manager_status(number)
    [reply] = yield [read(EcatCommand.FPRD, channel.station.address, register)]
    status = Status(register.unpack(answered(reply, channel.station, "mailbox status")))
    return Status.MAILBOX_FULL in status, reply


def read_request(channel: MailboxChannel) -> Request:
    layout = channel.layout
    return read_memory(
        channel.station.address, layout.send_offset, layout.send_size, repeatable=False
    )


def take(channel: MailboxChannel) -> Procedure[Mailbox | None]:
    """Read the mailbox. If the frame is lost, request a repetition.

    Return None if the mailbox was empty or contained a message that was already accepted.
    """
    for _ in range(RECOVERIES):
        [reply] = yield [read_request(channel)]
        if not reply.lost:
            channel.received_ns = reply.time_ns
            return decoded(channel, reply.data) if reply.working_counter else None
        channel.lost_reads += 1
        if not (yield from _request_repetition(channel)):
            return None
    raise ResponseTimeout(
        f"{channel.station}: {RECOVERIES} frames that read its mailbox were lost",
        hint="check the cables: the error counters at 0x0300 show which one is faulty",
    )


def decoded(channel: MailboxChannel, data: bytes) -> Mailbox | None:
    try:
        message = decode_mailbox(data)
    except DecodeError as error:
        raise MailboxError(
            f"{channel.station}: invalid mailbox message: {error}",
            hint="its firmware is at fault; record a capture of the start-up to see the bytes",
        ) from error
    return message if channel.accept(message) else None


def _request_repetition(channel: MailboxChannel) -> Procedure[bool]:
    """Request a repetition with SyncManager 1, ETG.1000.4 §6.7.2, and await the acknowledgement.

    The device then writes its last message to the buffer again. The request is a toggle bit, which
    is read first: its value may result from an earlier channel of the same mailbox.

    Returns:
        True if the buffer contains a message.

    Raises:
        MailboxError: The device does not acknowledge the request.
    """
    channel.repetitions += 1
    register, answer = sync_manager_activation(IN), sync_manager_pdi_control(IN)
    station = channel.station
    [reply] = yield [read(EcatCommand.FPRD, station.address, register)]
    present = Activation(register.unpack(answered(reply, station, "mailbox repeat request")))
    toggled = present ^ Activation.REPEAT_REQUEST
    [reply] = yield [write(EcatCommand.FPWR, station.address, register, int(toggled))]
    answered(reply, station, "mailbox repeat request")
    deadline, pace = Deadline(REPEAT_TIMEOUT), Pace()
    while True:
        [reply] = yield [read(EcatCommand.FPRD, station.address, answer)]
        value = PdiControl(answer.unpack(answered(reply, station, "mailbox repeat acknowledge")))
        acknowledged = (PdiControl.REPEAT_ACKNOWLEDGE in value) == (
            Activation.REPEAT_REQUEST in toggled
        )
        if acknowledged and (yield from _is_full(channel, IN))[0]:
            return True
        if deadline.passed(reply):
            break
        yield after(pace.pause())
    if acknowledged:
        return False
    raise MailboxError(
        f"{station} does not acknowledge the repeat request of its mailbox",
        hint="its stack does not support ETG.1000.4 §6.7.2: bring it to INIT, then to PRE-OP",
    )


def accepted(
    channel: MailboxChannel, message: Mailbox, accept: Callable[[Mailbox], T | None]
) -> T | None:
    if message.type is Type.ERROR:
        raise _error_reply(channel, message)
    emergency = _emergency(message)
    if emergency is not None:
        channel.add_emergency(emergency)
        return None
    answer = accept(message)
    if answer is None and not channel.deliver(message):
        channel.dropped += 1
    return answer


def _error_reply(channel: MailboxChannel, message: Mailbox) -> MailboxError:
    """Return the error for a mailbox error reply, even if the reply is malformed."""
    try:
        reply = decode_error(message.data)
        what = f"0x{reply.code:04X}: {reply.text}"
    except DecodeError as error:
        what = f"without a valid code ({error.message})"
    return MailboxError(
        f"{channel.station} answered with mailbox error {what}",
        hint="the device does not offer this mailbox service",
    )


def _emergency(message: Mailbox) -> coe.Emergency | None:
    header = int.from_bytes(message.data[: coe.HEADER_SIZE], "little")
    if message.type is not Type.COE or header >> 12 != coe.Service.EMERGENCY:
        return None
    try:
        decoded = coe.decode_coe(message.data)
    except DecodeError:
        return None  # truncated: treated like any other unexpected message
    return decoded if isinstance(decoded, coe.Emergency) else None
