"""Desks: distribution of the messages of all clients to the devices, by address."""

from __future__ import annotations

from collections.abc import Collection

from catenary.bus import MainDevice
from catenary.gateway.clients import Client
from catenary.gateway.desk import Closing, Desk
from catenary.gateway.gate import Gate
from catenary.gateway.refusal import Reason, Refusal, refusal_answer, to_client
from catenary.gateway.reports import Reports
from catenary.gateway.request import read_request
from catenary.gateway.workers import Workers
from catenary.wire.mailbox import Mailbox

FIRST_ADDRESS = 1001  # of the device at position 0 in TwinCAT, and for tools that expect it


class Desks:
    """Owner of the desks and their workers. Only the thread of the sockets calls it."""

    def __init__(self, main: MainDevice, writable: Collection[int], reports: Reports) -> None:
        self._main = main
        self._gate = Gate(main, writable)
        self._reports = reports
        self._workers = Workers()
        self._desks: dict[int, Desk] = {}
        self._closing = False

    def receive(self, client: Client, message: Mailbox) -> None:
        """Pass a message to the desk of its device. Answer if the device does not exist.

        Args:
            client: The client.
            message: Its message.
        """
        position = position_of(self._main, message.address)
        if position is not None:
            return self._desk(position).put(client, message)
        refusal = Refusal(Reason.NO_DEVICE, f"no device has the address 0x{message.address:04X}")
        self._reports.refused(None, client, refusal)
        answer = refusal_answer(read_request(message), refusal)
        self._reports.deliver(client, [to_client(message, answer)])

    def forget(self, client: Client) -> None:
        """Drop the messages of a client that has gone, and end its transfers."""
        for desk in self._desks.values():
            desk.forget(client)

    def sweep(self) -> None:
        """End transfers that their clients have not continued in time."""
        for desk in self._desks.values():
            desk.sweep()

    def close(self) -> None:
        """Drop all messages, and release all mailboxes. The thread of the sockets has ended."""
        self._closing = True
        for desk in self._desks.values():
            desk.close()
        self._workers.close()

    def _desk(self, position: int) -> Desk:
        if position not in self._desks:
            self._desks[position] = Desk(
                self._main,
                position,
                self._gate,
                self._reports,
                schedule=self._workers.submit,
                check_open=self._check_open,
            )
        return self._desks[position]

    def _check_open(self) -> None:
        if self._closing:
            raise Closing


def position_of(main: MainDevice, address: int) -> int | None:
    """Return the position of the device with an address; None if there is none.

    Addresses are those that the MainDevice configured (0x1001 for position 0), or those of TwinCAT
    (1001 for position 0), which IgH's gateway also reports to tools (etherlab-dev, April 2021).

    Args:
        main: The MainDevice.
        address: Address in a mailbox header. 0 is the MainDevice, which has no dictionary.
    """
    for sub in main.subs:
        if sub.station.address == address:
            return sub.position
    position = address - FIRST_ADDRESS
    return position if 0 <= position < len(main.subs) else None
