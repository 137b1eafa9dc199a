"""Procedure commands of a virtual drive: set, run, report the end, cancel. IEC 61800-7-204."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from catenary.virtual.mailbox import Mailbox
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.soe.parameter import Parameter, Refusal, idn
from catenary.virtual.soe.quirks import SoeQuirks

PROTOCOL = 5
SET, ENABLED, PENDING, FAILED = 1, 2, 4, 8
NOTIFICATION, STATE_ELEMENT = 5, 0x01
ALREADY_ACTIVE, INVALID_DATA = 0x7010, 0x7008
DURATION_NS = 5_000_000


class Commands:
    """Procedure commands of one drive. `actions` return True if the command succeeds."""

    def __init__(
        self,
        actions: Mapping[int, Callable[[], bool]],
        mailbox: Mailbox,
        scheduler: Scheduler,
        quirks: SoeQuirks,
    ) -> None:
        """Initialise the commands.

        Args:
            actions: Function of each command, by IDN.
            mailbox: Mailbox of the device, for notifications.
            scheduler: Delayed actions of the device.
            quirks: Differences from the standard.
        """
        self._actions = actions
        self._mailbox = mailbox
        self._scheduler = scheduler
        self._notifies = quirks.notifications
        self._stuck = {idn(each) for each in quirks.stuck_commands}
        self._failing = {idn(each) for each in quirks.failing_commands}
        self._starts: dict[int, int] = {}  # number of starts, so that a cancelled one never ends
        self.changed = False  # a command ended: the change bit of the status word

    def write(self, command: Parameter, data: bytes) -> None:
        """Set, interrupt or cancel a command. Raises Refusal if this is not possible."""
        if len(data) != 2:
            raise Refusal(INVALID_DATA)
        [value] = struct.unpack("<H", data)
        command.content = data
        if value == SET | ENABLED:
            self._start(command)
        elif value == SET:
            command.state = SET | PENDING if command.state else 0
        elif value == 0:
            command.state = 0
            self.changed = False
        else:
            raise Refusal(INVALID_DATA)

    def _start(self, command: Parameter) -> None:
        if command.state & SET:
            raise Refusal(ALREADY_ACTIVE)
        command.state = SET | ENABLED | PENDING
        start = self._starts[command.number] = self._starts.get(command.number, 0) + 1
        if command.number not in self._stuck:
            self._scheduler.after(DURATION_NS, lambda: self._finish(command, start))

    def _finish(self, command: Parameter, start: int) -> None:
        running = command.state == SET | ENABLED | PENDING
        if not running or start != self._starts[command.number]:
            return
        action = self._actions[command.number]
        succeeded = command.number not in self._failing and action()
        command.state = SET | ENABLED if succeeded else SET | ENABLED | PENDING | FAILED
        self.changed = True
        if self._notifies:
            head = struct.pack("<BBH", NOTIFICATION, STATE_ELEMENT, command.number)
            self._mailbox.send(PROTOCOL, head + struct.pack("<H", command.state))
