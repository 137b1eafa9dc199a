"""Mailbox protocols of a device beside CoE and FoE, as options of the virtual device.

Example: `Servo(protocols=[Ethernet(...)])`. Each option makes its server when the device starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from catenary.virtual.coe.dictionary import Dictionary
from catenary.virtual.mailbox import Mailbox
from catenary.virtual.scheduler import Scheduler


class ProtocolServer(Protocol):
    """Device side of one mailbox protocol."""

    def serve(self, payload: bytes) -> Iterable[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        ...

    def reset(self) -> None:
        """Discard all transfers. Called when the mailbox starts."""
        ...


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Parts of the device that a protocol server may use."""

    mailbox: Mailbox  # for messages that were not requested
    scheduler: Scheduler
    state: Callable[[], int]  # AL state
    receive_room: int  # longest data of a message to the device [bytes]
    send_room: int  # longest data of a message from the device [bytes]
    dictionary: Dictionary
    station_address: Callable[[], int]


class MailboxProtocol(Protocol):
    """A protocol that a device offers. It remembers what the device keeps without power."""

    @property
    def number(self) -> int:
        """Type of the protocol in the mailbox header: 1 AoE, 2 EoE, 5 SoE, 15 VoE."""
        ...

    def start(self, surroundings: Surroundings) -> ProtocolServer:
        """Make the server. Called at each start of the device."""
        ...
