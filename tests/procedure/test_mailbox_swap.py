"""`swap`: counters, deadlines and lost frames of single exchanges, with replies by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import MailboxError
from catenary.model.device import MailboxLayout
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.mailbox_channel import MailboxChannel
from catenary.procedure.mailbox_swap import Outgoing, Swapped, swap
from catenary.procedure.station import Station
from catenary.wire.mailbox import Type, decode_mailbox
from catenary.wire.sii import MailboxProtocol

EMPTY = bytes(1)  # status of a SyncManager without a message
WAIT_NS = 400_000_000


@pytest.fixture
def channel() -> MailboxChannel:
    layout = MailboxLayout(0x1000, 128, 0x1080, 128, MailboxProtocol.EOE)
    return MailboxChannel(Station(1, 0x1001), layout, counts=True)


def exchange(
    channel: MailboxChannel,
    outgoing: Outgoing,
    *,
    written: int = 0,
    lost: bool = False,
    read_lost: bool = False,
    time_ns: int = 0,
) -> tuple[Swapped, int]:
    """Return the result of an exchange without a message of the device, and the sent counter."""
    procedure = swap(channel, outgoing, expected=False)
    requests = next(procedure)
    assert isinstance(requests, list)
    assert all(isinstance(each, Request) for each in requests)
    status = Reply(EMPTY, 0 if lost else 1, lost, time_ns)
    write = Reply(b"", 0 if lost else written, lost, time_ns)
    read = Reply(b"", 0, lost or read_lost, time_ns)
    with pytest.raises(StopIteration) as ended:
        procedure.send([status, write, read])
    return ended.value.value, decode_mailbox(requests[1].data).counter


def test_a_repetition_has_the_same_counter(channel: MailboxChannel) -> None:
    outgoing = Outgoing(Type.EOE, b"data")
    assert exchange(channel, outgoing, lost=True) == (Swapped(False, False), 1)
    channel.unsure_ns = None  # the read mailbox was checked
    assert exchange(channel, outgoing, written=1) == (Swapped(True, False), 1)
    assert exchange(channel, Outgoing(Type.EOE, b"next"), written=1)[1] == 2


def test_a_message_gets_a_new_counter_after_another_procedure(channel: MailboxChannel) -> None:
    outgoing = Outgoing(Type.EOE, b"data")
    assert exchange(channel, outgoing) == (Swapped(False, False), 1)
    channel.counter = 2  # of a request for an object
    assert exchange(channel, outgoing, written=1) == (Swapped(True, False), 3)
    assert channel.counter == 3


def test_the_time_of_another_procedure_does_not_count(channel: MailboxChannel) -> None:
    outgoing = Outgoing(Type.EOE, b"data")
    for k in range(20):  # each attempt follows another request
        exchange(channel, outgoing, time_ns=k * WAIT_NS)
        channel.counter = channel.counter % 7 + 1


def repeat(channel: MailboxChannel, outgoing: Outgoing, *, read_lost: bool = False) -> None:
    """Make exchanges until the mailbox of the device was full for 8 s."""
    for k in range(20):
        channel.unsure_ns = None  # the read mailbox was checked
        exchange(channel, outgoing, read_lost=read_lost, time_ns=k * WAIT_NS)


@pytest.mark.parametrize(("stated", "seconds"), [(None, 1), (2.0, 2)])
def test_the_deadline_is_that_of_other_messages(
    channel: MailboxChannel, stated: float | None, seconds: int
) -> None:
    timeouts = replace(channel.station.timeouts, mailbox_request=stated)
    channel.station = channel.station._replace(timeouts=timeouts)
    outgoing = Outgoing(Type.EOE, b"data")
    with pytest.raises(MailboxError, match=f"has not read its mailbox for {seconds} s"):
        repeat(channel, outgoing)


def test_an_error_of_the_write_does_not_hide_a_lost_read(channel: MailboxChannel) -> None:
    outgoing = Outgoing(Type.EOE, b"data")
    with pytest.raises(MailboxError, match="has not read its mailbox"):
        repeat(channel, outgoing, read_lost=True)
    assert channel.unsure_ns is not None
