"""Ethernet port of a device, ETG.1000.6 §5.7: its addresses, its filter, and its frames.

Where the standard is silent:

- A device may answer any request that it does not support as if an address was set (SSC,
  ecateoe.c). Such an answer counts as a refusal.
- Ethernet frames that arrive before the answer go to the subscriber of the mailbox.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

from catenary.errors import DecodeError, EoeError, MailboxError
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, converse, exclusively
from catenary.procedure.mailbox_swap import Outgoing, swap
from catenary.wire import mailbox
from catenary.wire.eoe import (
    GetAddress,
    GetAddressResult,
    GetFilter,
    GetFilterResult,
    Result,
    SetAddress,
    SetAddressResult,
    SetFilter,
    SetFilterResult,
    decode_eoe,
    result_text,
)
from catenary.wire.eoe_address import EthernetAddress, MacFilter
from catenary.wire.mailbox import Mailbox, Type

Request = GetAddress | GetFilter | SetAddress | SetFilter
EMPTY_MAX = 3  # turns without a message, until the device is expected to have no more
T = TypeVar("T", GetAddressResult, GetFilterResult, SetAddressResult, SetFilterResult)

HINTS = {
    Result.UNSUPPORTED_TYPE: "its own page or its manual shows how to set it",
    Result.NO_IP_SUPPORT: "the device may only have a switch: ask for the address of what is "
    "connected to it",
    Result.NO_DHCP_SUPPORT: "set the IP address and the mask",
}


class Source(Protocol):
    """Interface to the messages that wait to be sent to a device."""

    def next(self) -> Outgoing | None:
        """Return the first waiting message; None if there is none."""
        ...

    def done(self, outgoing: Outgoing) -> None:
        """Remove a message that was sent, or that is given up."""
        ...


def room_to(channel: MailboxChannel) -> int:
    """Return the data of a message to the device [bytes]."""
    return channel.layout.receive_size - mailbox.HEADER_SIZE


def read_address(channel: MailboxChannel, *, port: int = 0) -> Procedure[EthernetAddress]:
    """Read the addresses of a device.

    Args:
        channel: The mailbox of the device.
        port: Port of the device; 0 if it has only one.

    Raises:
        EoeError: The device refuses the request.
        ResponseTimeout: The device does not answer.
        MailboxError: The device does not support EoE, or violates the protocol.
    """
    answer = yield from _ask(channel, GetAddress(port), GetAddressResult, "its addresses")
    if answer.address is None:
        raise MailboxError(
            f"{channel.station}: its answer contains no addresses",
            hint="its firmware is at fault; record a capture to see the bytes",
        )
    return answer.address


def write_address(
    channel: MailboxChannel, address: EthernetAddress, *, port: int = 0
) -> Procedure[EthernetAddress]:
    """Set the addresses of a device, and return what was sent.

    If a field is missing before a given one, it is first read from the device: stacks disagree on
    the place of later fields then (`wire/eoe_address.py`), and the SSC deletes a missing MAC.

    Args:
        channel: The mailbox of the device.
        address: Addresses. Fields with None do not change.
        port: Port of the device; 0 if it has only one.

    Raises:
        EoeError: The device refuses an address.
        ResponseTimeout: The device does not answer.
        MailboxError: The device does not support EoE, or violates the protocol.
        ValueError: A field does not fit.
    """
    if address.has_gap:
        address = yield from _filled(channel, address, port)
    answer = yield from _ask(channel, SetAddress(address, port), SetAddressResult, "an address")
    _check(channel, answer.result, "an address")
    return address


def read_filter(channel: MailboxChannel, *, port: int = 0) -> Procedure[MacFilter]:
    """Read the address filter of a device. The arguments and errors are those of `read_address`."""
    answer = yield from _ask(channel, GetFilter(port), GetFilterResult, "its address filter")
    return MacFilter() if answer.filter is None else answer.filter


def write_filter(channel: MailboxChannel, filter: MacFilter, *, port: int = 0) -> Procedure[None]:
    """Set the address filter of a device.

    Args:
        channel: The mailbox of the device.
        filter: The filter. The errors are those of `write_address`.
        port: Port of the device; 0 if it has only one.
    """
    answer = yield from _ask(channel, SetFilter(filter, port), SetFilterResult, "a filter")
    _check(channel, answer.result, "a filter")


def pump(channel: MailboxChannel, source: Source, most: int) -> Procedure[bool]:
    """Send waiting Ethernet frames, and receive those of the device, until no message waits.

    Each message is one turn of the mailbox, so that other procedures wait for at most one message.

    Args:
        channel: The mailbox of the device. Its subscriber receives the fragments.
        source: Messages to send.
        most: Largest number of turns.

    Returns:
        True if a message was sent or received.

    Raises:
        ResponseTimeout: The device does not answer.
        MailboxError: The device violates the protocol, or does not support EoE.
    """
    moved, empty = False, EMPTY_MAX
    for _ in range(most):
        outgoing = source.next()
        # After a first message, the next one is read without checking: it saves an exchange.
        turn = swap(channel, outgoing, expected=moved)
        sent, received = yield from exclusively(channel, turn)
        if outgoing is not None and (sent or outgoing.given_up):
            source.done(outgoing)
        moved |= sent or received
        empty = 0 if sent or received else empty + 1
        if empty > EMPTY_MAX or not moved:
            break
    return moved


def _filled(
    channel: MailboxChannel, address: EthernetAddress, port: int
) -> Procedure[EthernetAddress]:
    """Return the address with its gaps filled by the device's own fields, as far as known."""
    try:
        own = yield from read_address(channel, port=port)
    except (EoeError, MailboxError):
        return address  # it cannot be read: the device has to understand a gap
    last = max(k for k, name in enumerate(_NAMES) if getattr(address, name) is not None)
    missing = {name: getattr(own, name) for name in _NAMES[:last] if getattr(address, name) is None}
    return replace(address, **missing)


_NAMES = ("mac", "ip", "mask", "gateway", "dns", "name")


def _ask(channel: MailboxChannel, request: Request, expected: type[T], what: str) -> Procedure[T]:
    """Send a request and return its answer. Refuse one of another type."""
    accept = _acceptor(channel, expected)
    data = request.encode()
    if len(data) > room_to(channel):
        raise MailboxError(
            f"{channel.station}: a message of {len(data)} bytes does not fit into its mailbox, "
            f"which has room for {room_to(channel)}",
            hint="its SII or its ESI states the size of the mailbox",
        )
    talk: Procedure[T | int] = converse(channel, Type.EOE, data, accept)
    answer = yield from exclusively(channel, talk)
    if isinstance(answer, int):
        raise _refused(channel, answer, what)
    if isinstance(answer, GetAddressResult | GetFilterResult):
        _check(channel, answer.result, what)
    return answer


def _acceptor(channel: MailboxChannel, expected: type[T]) -> Callable[[Mailbox], T | int | None]:
    """Return the function that accepts the answer, or the result of a refusal."""

    def accept(received: Mailbox) -> T | int | None:
        if received.type is not Type.EOE:
            return None
        try:
            message = decode_eoe(received.data)
        except DecodeError as error:
            raise MailboxError(
                f"{channel.station}: invalid EoE message: {error}",
                hint="its firmware is at fault; record a capture to see the bytes",
            ) from error
        if isinstance(message, expected):
            return message
        if isinstance(message, SetAddressResult) and message.result:
            return message.result
        return None

    return accept


def _check(channel: MailboxChannel, result: int, what: str) -> None:
    if result:
        raise _refused(channel, result, what)


def _refused(channel: MailboxChannel, result: int, what: str) -> EoeError:
    return EoeError(
        f"{channel.station} refused {what} with 0x{result:04X}: {result_text(result)}",
        position=channel.station.position,
        result=result,
        hint=HINTS.get(Result(result), "") if result in set(Result) else "",
    )
