"""Wait for mailbox messages that were not requested, which a subscriber stores in a queue."""

from __future__ import annotations

from collections.abc import Sized

from catenary.procedure.exchange import Procedure, after, read
from catenary.procedure.mailbox import IN, MailboxChannel, drain, exclusively
from catenary.procedure.station import Deadline, answered, checked_timeout
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import sync_manager_status
from catenary.wire.sync_manager import Status

POLL = 2e-3  # [s] between two checks for a message


def await_delivery(channel: MailboxChannel, queue: Sized, timeout: float) -> Procedure[None]:
    """Return the procedure that reads the mailbox until a queue has an entry, or until the timeout.

    Args:
        channel: The mailbox of the device.
        queue: The queue, which a subscriber of the channel fills.
        timeout: Longest time to wait [s]; 0: check the mailbox once.

    Raises:
        MailboxError: A message is invalid or a mailbox error.
        ValueError: The timeout is negative or infinite.
    """
    return _await(channel, queue, checked_timeout(timeout))


def _await(channel: MailboxChannel, queue: Sized, timeout: float) -> Procedure[None]:
    deadline, register = Deadline(timeout), sync_manager_status(IN)
    while not queue:
        [reply] = yield [read(EcatCommand.FPRD, channel.station.address, register)]
        status = Status(register.unpack(answered(reply, channel.station, "mailbox status")))
        if Status.MAILBOX_FULL in status:
            yield from exclusively(channel, drain(channel, lambda _: None))
        if queue or not timeout or deadline.passed(reply):
            return
        yield after(POLL)
