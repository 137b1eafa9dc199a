"""Mailbox of a device, ETG.1000.4 §5.6: requests arrive in SM0, and answers leave through SM1.

Each mailbox holds one message at a time. The last answer is repeated on request.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Iterable
from typing import Protocol

from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.scheduler import Scheduler

HEADER = struct.Struct("<HHBB")  # length, address, channel and priority, type and counter
ERROR_PROTOCOL, COE_PROTOCOL, FOE_PROTOCOL = 0, 3, 4
ERROR_SYNTAX, ERROR_UNSUPPORTED_PROTOCOL, ERROR_TOO_SHORT, ERROR_SIZE = 0x01, 0x02, 0x06, 0x08
WAITING_MAX = 16  # unsolicited messages that wait for the MainDevice


class MailboxPorts(Protocol):
    """PDI side of the two mailbox SyncManagers."""

    def fetch_request(self) -> bytes | None: ...

    def put_answer(self, data: bytes) -> bool: ...

    def take_back_answer(self) -> bytes | None: ...

    def acknowledge_repeat(self) -> None: ...


class Mailbox:
    """Device side of a mailbox, with the answers that wait for the MainDevice."""

    def __init__(
        self,
        ports: MailboxPorts,
        scheduler: Scheduler,
        serve: Callable[[int, bytes], Iterable[bytes] | int],
        *,
        delay_ns: int,
        quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
    ) -> None:
        """Initialise the mailbox.

        Args:
            ports: PDI side of the SyncManagers.
            scheduler: Delayed actions of the device.
            serve: Function that receives the protocol and the data of a message. It returns the
                answers, or the code of a mailbox error.
            delay_ns: Time until a request is fetched [ns].
            quirks: Differences from the standard.
        """
        self._ports = ports
        self._scheduler = scheduler
        self._serve = serve
        self._delay_ns = delay_ns
        self._quirks = quirks
        self.silent = False
        self.requests = 0
        self.on_read: list[Callable[[], None]] = []  # called when the MainDevice has read a message
        self.reset()

    def reset(self) -> None:
        """Discard all messages and restart the counter. Called on entry to PRE-OP or BOOT."""
        self._waiting: deque[bytes] = deque()
        self._in_buffer: bytes | None = None
        self._last_read: bytes | None = None
        self._counter = 0
        self._request_counter = 0
        self._fetching = False

    def silence(self, silent: bool) -> None:
        """Stop the mailbox, or resume it: fetch a waiting request and deliver waiting answers."""
        self.silent = silent
        self.request_written()
        self._deliver()

    def delay(self, nanoseconds: int) -> None:
        """Add `nanoseconds` to the time until a request is fetched. The sum is at least 0."""
        self._delay_ns = max(0, self._delay_ns + nanoseconds)

    def request_written(self) -> None:
        if not self._fetching and not self.silent:
            self._fetching = True
            self._scheduler.after(self._delay_ns, self._fetch)

    def _fetch(self) -> None:
        self._fetching = False
        request = self._ports.fetch_request()
        if request is None:
            return
        self.requests += 1
        for answer in self._answers(request):
            self._queue(answer)
        self._deliver()

    def _answers(self, request: bytes) -> Iterable[tuple[int, bytes]]:
        length, _address, _channel, kind = HEADER.unpack_from(request)
        self._request_counter = kind >> 4 & 7
        payload = request[HEADER.size : HEADER.size + length]
        protocol = kind & 0x0F
        if length > len(request) - HEADER.size:
            return [(ERROR_PROTOCOL, struct.pack("<HH", 1, ERROR_SIZE))]
        if self._quirks.error_reply != "none" and protocol == COE_PROTOCOL:
            reply = struct.pack("<HH", 1, ERROR_UNSUPPORTED_PROTOCOL)
            return [(ERROR_PROTOCOL, reply[: 2 if self._quirks.error_reply == "short" else 4])]
        served = self._serve(protocol, payload)
        if isinstance(served, int):
            return [(ERROR_PROTOCOL, struct.pack("<HH", 1, served))]
        return [(protocol, answer) for answer in served]

    def _queue(self, answer: tuple[int, bytes]) -> None:
        protocol, payload = answer
        header = HEADER.pack(len(payload), 0, 0, protocol | self._next_counter() << 4)
        self._waiting.append(header + payload)

    def _next_counter(self) -> int:
        self._counter = self._counter % 7 + 1
        given = {"echoed": self._request_counter, "stuck": 1, "zero": 0}
        return given.get(self._quirks.counter, self._counter)

    def send(self, protocol: int, payload: bytes) -> bool:
        """Queue an unsolicited message, for example an emergency.

        Args:
            protocol: Protocol of the message.
            payload: Data of the message.

        Returns:
            False if the message was dropped, because 16 messages are waiting.
        """
        if len(self._waiting) >= WAITING_MAX:
            return False
        self._queue((protocol, payload))
        self._deliver()
        return True

    def _deliver(self) -> None:
        if self._waiting and not self.silent and self._ports.put_answer(self._waiting[0]):
            self._in_buffer = self._waiting.popleft()

    def answer_read(self) -> None:
        if self._in_buffer is not None:
            self._last_read, self._in_buffer = self._in_buffer, None
        self._deliver()
        for listener in self.on_read:
            listener()

    @property
    def waiting(self) -> int:
        """Number of messages that wait until SM1 is empty."""
        return len(self._waiting)

    def repeat_requested(self) -> None:
        """Put the last answer into SM1 again, ahead of all others, and acknowledge the request."""
        if self._last_read is not None:
            if self._in_buffer is not None and self._ports.take_back_answer() is not None:
                self._waiting.appendleft(self._in_buffer)
            self._in_buffer = None
            self._waiting.appendleft(self._last_read)
            self._deliver()
        self._ports.acknowledge_repeat()
