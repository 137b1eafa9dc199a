"""Router: distribution of the messages of all clients to the devices, by address."""

from __future__ import annotations

from catenary.bus import MainDevice
from catenary.gateway.clients import Client
from catenary.gateway.device_queue import Closing, DeviceQueue
from catenary.gateway.policy import Policy
from catenary.gateway.refusal import Reason, Refusal, refusal_answer, to_client
from catenary.gateway.reports import Reports
from catenary.gateway.request import read_request
from catenary.gateway.workers import Workers
from catenary.wire.mailbox import Mailbox

FIRST_ADDRESS = 1001  # of the device at position 0 in TwinCAT, and for tools that expect it


class Router:
    """Owner of the queues of the devices, and of the workers. Only the socket thread calls it."""

    def __init__(self, main: MainDevice, policy: Policy, reports: Reports) -> None:
        self._main = main
        self._policy = policy
        self._reports = reports
        self._workers = Workers()
        self._queues: dict[int, DeviceQueue] = {}
        self._closing = False

    def receive(self, client: Client, message: Mailbox) -> None:
        """Queue a message for its device. Answer if the device does not exist.

        Args:
            client: The client.
            message: Its message.
        """
        position = position_of(self._main, message.address)
        if position is not None:
            return self._queue(position).put(client, message)
        refusal = Refusal(Reason.NO_DEVICE, f"no device has the address 0x{message.address:04X}")
        self._reports.refused(None, client, refusal)
        answer = refusal_answer(read_request(message), refusal)
        self._reports.deliver(client, [to_client(message, answer)])

    def forget(self, client: Client) -> None:
        """Drop the messages of a client that has gone, and end its transfers."""
        for each in self._queues.values():
            each.forget(client)

    def sweep(self) -> None:
        """End transfers that their clients have not continued in time."""
        for each in self._queues.values():
            each.sweep()

    def close(self) -> None:
        """Drop all messages, and release all mailboxes. The thread of the sockets has ended."""
        self._closing = True
        for each in self._queues.values():
            each.close()
        self._workers.close()

    def _queue(self, position: int) -> DeviceQueue:
        if position not in self._queues:
            self._queues[position] = DeviceQueue(
                self._main,
                position,
                self._policy,
                self._reports,
                schedule=self._workers.submit,
                check_open=self._check_open,
            )
        return self._queues[position]

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
