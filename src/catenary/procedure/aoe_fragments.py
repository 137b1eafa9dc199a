"""AoE messages that exceed the mailbox: fragments in both directions, ETG.1020.

Fragments of a request carry the flag NO_RETURN, so that the device does not acknowledge them. The
SSC writes through a null pointer when it acknowledges the last one (ecataoe.c,
AOE_FragmentedCmdInd). The SSC also sends all fragments of a response without waiting. A fragment of
a response is therefore acknowledged only if the device waits for it.

The next fragment of a response may replace one whose frame was lost, before it can be repeated. The
request then fails: it is not known here if it may be repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from catenary.errors import DecodeError, MailboxError, ResponseTimeout
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import (
    GRACE,
    RECOVERIES,
    MailboxChannel,
    converse,
    drain,
    further,
    send_only,
)
from catenary.wire.aoe import (
    REST_SIZE,
    AoeMessage,
    Flag,
    Fragment,
    Message,
    decode_aoe,
    fragments,
    join,
)
from catenary.wire.mailbox import HEADER_SIZE, Mailbox, Type


def parts_of(channel: MailboxChannel, message: Message) -> list[bytes]:
    """Return a request as mailbox data: one element, or its fragments if it exceeds the mailbox.

    Each request has another packet number. The SSC refuses the first fragment of a request whose
    number is that of an incomplete one (ecataoe.c, AOE_FragmentedCmdInd).
    """
    room = channel.layout.receive_size - HEADER_SIZE
    encoded = message.encode()
    if len(encoded) <= room:
        return [encoded]
    return [part.encode() for part in fragments(message, room, message.invoke_id & 0xFFFF)]


def send_message(
    channel: MailboxChannel,
    parts: Sequence[bytes],
    accept: Callable[[Mailbox], AoeMessage | None],
    timeout: float,
) -> Procedure[AoeMessage]:
    """Send a request and return its answer, or the first fragment of its answer.

    A device may answer before it has received all fragments, for example with an error. It may also
    send notifications meanwhile, and stop reading while its mailbox is full.

    Args:
        channel: The mailbox of the device.
        parts: The request, from `parts_of`.
        accept: Function that accepts the answer.
        timeout: Longest time until the device answers [s].
    """
    *others, last = parts
    for number, part in enumerate(others):
        if not (yield from send_only(channel, Type.AOE, part, attempts=RECOVERIES)):
            raise ResponseTimeout(
                f"{channel.station}: {RECOVERIES} frames with fragment {number} of an AoE request "
                "were lost",
                hint="check the cables: the error counters at 0x0300 show which one is faulty",
            )
        arrived: Procedure[list[AoeMessage]] = drain(channel, accept)
        if early := (yield from arrived):
            return early[0]
    end: Procedure[AoeMessage] = converse(channel, Type.AOE, last, accept, timeout=timeout)
    return (yield from end)


def collect(
    channel: MailboxChannel, first: Fragment, limit: int, timeout: float
) -> Procedure[Message]:
    """Receive the other fragments of an answer, and return the answer.

    Args:
        channel: The mailbox of the device.
        first: The first fragment.
        limit: Longest accepted data of the answer [bytes].
        timeout: Longest time until a fragment arrives [s].

    Raises:
        MailboxError: The answer is too long, or a fragment is missing, empty or invalid.
        ResponseTimeout: A fragment does not arrive.
    """
    data = bytearray(first.data)
    total = first.total
    if total > limit + REST_SIZE:
        raise _violation(
            channel, f"announces an answer of {total} bytes; {limit} at most were requested"
        )
    last = first
    while len(data) < total:
        last = yield from _next(channel, last, timeout)
        if not last.data:
            raise _violation(channel, f"sent fragment {last.number} without data")
        data += last.data
    if len(data) > total:
        raise _violation(channel, f"sent {len(data)} bytes in fragments; it announced {total}")
    try:
        return join(first, bytes(data))
    except DecodeError as error:
        raise _violation(channel, f"sent invalid fragments: {error}") from error


def _next(channel: MailboxChannel, before: Fragment, timeout: float) -> Procedure[Fragment]:
    """Return the fragment after `before`. Acknowledge that one if the device waits for this."""
    accept = _acceptor(channel, before)
    if before.flags & Flag.NO_RETURN:
        return (yield from further(channel, accept, timeout=timeout, kind=Type.AOE))
    try:
        return (yield from further(channel, accept, timeout=GRACE, kind=Type.AOE))
    except ResponseTimeout:
        acknowledgement = before.acknowledge().encode()
        return (yield from converse(channel, Type.AOE, acknowledgement, accept, timeout=timeout))


def _acceptor(channel: MailboxChannel, before: Fragment) -> Callable[[Mailbox], Fragment | None]:
    """Return the function that accepts the next fragment. Repeated fragments are dropped."""

    def accept(received: Mailbox) -> Fragment | None:
        if received.type is not Type.AOE:
            return None
        try:
            found = decode_aoe(received.data)
        except DecodeError as error:
            raise _violation(channel, f"sent an invalid message: {error}") from error
        if not isinstance(found, Fragment) or found.packet != before.packet:
            return None
        if found.is_response or found.number <= before.number:
            return None
        if found.number > before.number + 1:
            raise _violation(
                channel, f"sent fragment {found.number} instead of {before.number + 1}"
            )
        return found

    return accept


def _violation(channel: MailboxChannel, what: str) -> MailboxError:
    return MailboxError(
        f"{channel.station} {what} (AoE)",
        hint="repeat the request. If it fails again, its firmware is at fault: read smaller parts",
    )
