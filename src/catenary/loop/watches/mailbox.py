"""Watch of mailboxes, for messages that were not requested: emergencies and late answers.

If a device has a spare FMMU, the full bit of its mailbox is part of the cyclic data and costs no
extra frame (plan/mailboxes.py). The other devices are polled by register, one device at a time. If
all devices have such a bit, they are also polled, but less often.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.bus import AcyclicRunner, Pending, SubDevice
from catenary.errors import CatenaryError
from catenary.plan.planner import Plan
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, drain, exclusively

POLL_NS = 10_000_000  # between two polls if a device has no bit in the cyclic data
SLOW_POLL_NS = 100_000_000  # between two polls if all devices have such a bit

NEVER_NS = 1 << 62


class MailboxWatch:
    """State of the mailbox checks. The thread that steps the queue calls `look`.

    `words`: last integers of the loop's private input buffer, with one bit per device. Each
    iteration updates them.
    """

    def __init__(
        self, plan: Plan, subs: Sequence[SubDevice], words: Sequence[int], runner: AcyclicRunner
    ) -> None:
        self._subs = subs
        self._words = words
        self._runner = runner
        self._shown = plan.mailboxes.devices
        with_mailbox = [sub.position for sub in subs if sub.channel is not None]
        unseen = [position for position in with_mailbox if position not in self._shown]
        self._polled = unseen or with_mailbox
        self._pace_ns = POLL_NS if unseen else SLOW_POLL_NS
        self._next = 0
        self._due_ns = 0
        self._reading: dict[int, Pending[None]] = {}
        self._read_in: dict[int, int] = {}  # position → cycle in which its mailbox was read

    @property
    def sees_mail(self) -> bool:
        """True if a mailbox was full in this cycle, or is being read."""
        return bool(self._reading) or any(self._words)

    @property
    def next_look_ns(self) -> int:
        """Time of the next poll [ns]; NEVER_NS if no device is polled."""
        return self._due_ns if self._polled else NEVER_NS

    def look(self, now_ns: int, cycle: int) -> None:
        """Start reading every full mailbox, and poll the next device if a poll is due.

        Mailboxes that other procedures are using are left out.

        Args:
            now_ns: Time of the link's clock [ns].
            cycle: Number of the cycle.
        """
        if self._reading:
            self._note_ends(cycle)
        for rank, word in enumerate(self._words):
            if word:
                self._read_full(32 * rank, word, cycle)
        if self._polled and now_ns >= self._due_ns:
            self._due_ns = now_ns + self._pace_ns
            self._next = (self._next + 1) % len(self._polled)
            self._read(self._polled[self._next])

    def _note_ends(self, cycle: int) -> None:
        for position in [p for p, reading in self._reading.items() if reading.done]:
            del self._reading[position]
            self._read_in[position] = cycle  # the bit of this cycle may be older than the read

    def _read_full(self, first: int, word: int, cycle: int) -> None:
        for rank in range(first, first + word.bit_length()):
            position = self._shown[rank]
            if word >> (rank - first) & 1 and self._read_in.get(position, -1) < cycle:
                self._read(position)

    def _read(self, position: int) -> None:
        channel = self._subs[position].channel
        if channel is not None and not channel.turns and position not in self._reading:
            self._reading[position] = self._runner.submit(_emptied(channel))


def _emptied(channel: MailboxChannel) -> Procedure[None]:
    try:
        yield from exclusively(channel, drain(channel, lambda _: None))
    except CatenaryError:
        return  # no answer or a malformed one: the next procedure on this mailbox reports it
