"""ADS over EtherCAT (AoE), ETG.1020: requests to a device, and its NetId.

A response belongs to a request if the command and the invoke ID are the same. Other responses are
dropped, because they answer a request that has timed out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import NamedTuple, TypeVar

from catenary.errors import AdsError, DecodeError, MailboxError, ResponseTimeout
from catenary.procedure.aoe_fragments import collect, parts_of, send_message
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, exclusively
from catenary.procedure.station import checked_timeout
from catenary.wire import ads
from catenary.wire.ads_error import ads_meaning
from catenary.wire.ads_response import decode_data, decode_result
from catenary.wire.aoe import Address, AoeMessage, Command, Fragment, Message, decode_aoe
from catenary.wire.mailbox import Mailbox, Type

T = TypeVar("T")

ANSWER_TIMEOUT = 5.0  # [s] until a device answers
DEVICE_PORT = 0xFFFF  # of the device itself (SSC, aoeappl.c)
MAIN_PORT = 0x8000  # of the MainDevice
MAIN_NET_ID = bytes((127, 0, 0, 1, 1, 1))
MAX_SIZE = 1 << 22  # largest accepted data [bytes]
NET_ID_PLACE = (1, 3)  # index group and offset of the NetId of a device (SSC, ecataoe.c)
RESULT_SIZE = 40  # of the data of a response in addition to the data that was read, at most


class Place(NamedTuple):
    """Data of a device: port, index group and index offset."""

    port: int
    group: int
    offset: int

    def __str__(self) -> str:
        return f"group 0x{self.group:X}, offset 0x{self.offset:X} at port {self.port}"


@dataclass(slots=True)
class AdsPeer:
    """NetIds of the MainDevice and of one device, and the last invoke ID."""

    net_id: bytes
    source: bytes = MAIN_NET_ID
    invoke_ids: count[int] = field(default_factory=lambda: count(1))

    def message(self, request: ads.Request, port: int, source_port: int = MAIN_PORT) -> Message:
        """Return the message of a request, with the next invoke ID."""
        return Message(
            Address(self.net_id, port),
            Address(self.source, source_port),
            request.command,
            request.encode(),
            next(self.invoke_ids) & 0xFFFF_FFFF,
        )


def own_net_id(station_address: int) -> bytes:
    """Return the NetId that Catenary gives a device: 127.0.0.1 and its station address."""
    return bytes((127, 0, 0, 1)) + station_address.to_bytes(2, "big")


def request(
    channel: MailboxChannel,
    peer: AdsPeer,
    request: ads.Request,
    port: int,
    *,
    size: int = 0,
    timeout: float = ANSWER_TIMEOUT,
    what: str = "",
) -> Procedure[bytes]:
    """Return the procedure that sends a request and returns the data of its response.

    Args:
        channel: The mailbox of the device.
        peer: The NetIds.
        request: The request.
        port: ADS port in the device.
        size: Longest accepted data [bytes].
        timeout: Longest time until the device answers [s].
        what: What was requested, for errors.

    Raises:
        AdsError: The device refuses the request.
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or does not support AoE.
        ValueError: The size, the timeout or a field is out of range.
    """
    if not 0 <= size <= MAX_SIZE:
        raise ValueError(f"AoE: {size} bytes; 0 to {MAX_SIZE} are possible")
    message = peer.message(request, port)
    if len(message.data) > MAX_SIZE + RESULT_SIZE:
        raise ValueError(f"AoE: {len(message.data)} bytes; at most {MAX_SIZE} are possible")
    text = what or f"{request.command.name} at port {port}"
    return _ask(channel, message, size + RESULT_SIZE, timeout, text)


def read(
    channel: MailboxChannel,
    peer: AdsPeer,
    place: Place,
    size: int,
    *,
    data: bytes | None = None,
    timeout: float = ANSWER_TIMEOUT,
) -> Procedure[bytes]:
    """Return the procedure that reads data, after it wrote `data` in the same request, if given.

    Args:
        channel: The mailbox of the device.
        peer: The NetIds.
        place: The data.
        size: Number of bytes to read. The device may send fewer.
        data: Data to write in the same request; None: only read.
        timeout: Longest time until the device answers [s].

    Raises:
        AdsError: The device refuses the request.
        MailboxError: The device sends more than `size` bytes, or violates the protocol.
        ResponseTimeout: The device does not answer.
        ValueError: A value is out of range.
    """
    asked: ads.Request = ads.Read(place.group, place.offset, size)
    if data is not None:
        asked = ads.ReadWrite(place.group, place.offset, size, data)
    what = f"{asked.command.name} of {size} bytes, {place}"
    exchange = request(channel, peer, asked, place.port, size=size, timeout=timeout, what=what)
    return _read(channel, exchange, size, what)


def _read(
    channel: MailboxChannel, exchange: Procedure[bytes], size: int, what: str
) -> Procedure[bytes]:
    found = yield from answered_as(channel, decode_data, exchange)
    if len(found) > size:
        raise MailboxError(
            f"{channel.station}: {what}: the device sent {len(found)} bytes",
            hint="its firmware is at fault: it sent more than requested",
        )
    return found


def write(
    channel: MailboxChannel,
    peer: AdsPeer,
    place: Place,
    data: bytes,
    *,
    timeout: float = ANSWER_TIMEOUT,
) -> Procedure[None]:
    """Return the procedure that writes data. The arguments and errors are those of `read`."""
    asked = ads.Write(place.group, place.offset, data)
    what = f"WRITE of {len(data)} bytes, {place}"
    exchange = request(channel, peer, asked, place.port, timeout=timeout, what=what)
    return _discard(exchange)


def _discard(exchange: Procedure[bytes]) -> Procedure[None]:
    yield from exchange


def assign_net_id(channel: MailboxChannel, peer: AdsPeer) -> Procedure[None]:
    """Return the procedure that writes the NetId of a device into the device.

    Both ports are the station address (SSC, ecataoe.c, AOE_ServiceInd).
    """
    address = channel.station.address
    message = peer.message(ads.Write(*NET_ID_PLACE, peer.net_id), address, address)
    what = "assignment of the NetId"
    return _discard(_ask(channel, message, RESULT_SIZE, ANSWER_TIMEOUT, what))


def answered_as(
    channel: MailboxChannel, decode: Callable[[bytes], T], asked: Procedure[bytes]
) -> Procedure[T]:
    """Run a request and return its decoded response. Raises MailboxError if it is invalid."""
    return decoded(channel, decode, (yield from asked))


def decoded(channel: MailboxChannel, decode: Callable[[bytes], T], data: bytes) -> T:
    """Return decoded data of a response. Raises MailboxError if the data are invalid."""
    try:
        return decode(data)
    except DecodeError as error:
        raise _invalid(channel, error) from error


def _ask(
    channel: MailboxChannel, message: Message, limit: int, timeout: float, what: str
) -> Procedure[bytes]:
    """Return the procedure. A value that does not fit is an error before anything is sent."""
    parts = parts_of(channel, message)
    checked_timeout(timeout)
    return exclusively(channel, _exchange(channel, message, parts, limit, timeout, what))


def _exchange(
    channel: MailboxChannel,
    message: Message,
    parts: list[bytes],
    limit: int,
    timeout: float,
    what: str,
) -> Procedure[bytes]:
    others: list[int] = []  # invoke IDs of other responses
    accept = _acceptor(channel, message, others)
    try:
        answer = yield from send_message(channel, parts, accept, timeout)
        if isinstance(answer, Fragment):
            answer = yield from collect(channel, answer, limit, timeout)
    except ResponseTimeout as error:
        if not others:
            raise
        raise ResponseTimeout(
            f"{channel.station}: {what}: no response to invoke ID {message.invoke_id} within "
            f"{timeout:g} s, but to {', '.join(map(str, others[:4]))}",
            hint="its firmware does not return the invoke ID, or a second master accesses it",
        ) from error
    return _successful(channel, answer, what)


def _acceptor(
    channel: MailboxChannel, request: Message, others: list[int]
) -> Callable[[Mailbox], AoeMessage | None]:
    """Return the function that accepts the response to a request, or its first fragment."""

    def accept(received: Mailbox) -> AoeMessage | None:
        if received.type is not Type.AOE:
            return None
        try:
            found = decode_aoe(received.data)
        except DecodeError as error:
            raise _invalid(channel, error) from error
        if isinstance(found, Fragment):
            return found if found.is_answer and found.invoke_id == request.invoke_id else None
        if not found.is_response or found.command == Command.NOTIFICATION:
            return None
        if found.invoke_id == request.invoke_id and found.command == request.command:
            return found
        others.append(found.invoke_id)
        return None

    return accept


def _successful(channel: MailboxChannel, answer: Message, what: str) -> bytes:
    """Return the data of a response. Raises AdsError if the device refuses the request."""
    code = answer.error or decoded(channel, decode_result, answer.data)
    if code == 0:
        return answer.data
    meaning = ads_meaning(code)
    raise AdsError(
        f"{channel.station}: {what} refused with 0x{code:04X}: {meaning.text}",
        position=channel.station.position,
        code=code,
        hint=meaning.hint,
    )


def _invalid(channel: MailboxChannel, error: DecodeError) -> MailboxError:
    return MailboxError(
        f"{channel.station}: invalid AoE message: {error}",
        hint="its firmware is at fault; record a capture to see the bytes",
    )
