"""Players for procedures: simulated replies, without a link or a runner."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TypeVar

from catenary.model.device import MailboxLayout
from catenary.procedure.exchange import After, Procedure, Reply, Request
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.station import Station
from catenary.wire.coe import (
    Abort,
    DownloadRequest,
    DownloadResponse,
    DownloadSegment,
    DownloadSegmentResponse,
    UploadRequest,
    UploadResponse,
    UploadSegment,
    UploadSegmentRequest,
    decode_coe,
)
from catenary.wire.datagram import EcatCommand
from catenary.wire.mailbox import Mailbox, Type, decode_mailbox, next_counter
from catenary.wire.sii import MailboxProtocol

T = TypeVar("T")

STATION = Station(3, 0x1004, "Probe")
ROUND_TRIP_NS = 100_000
LAYOUT = MailboxLayout(0x1000, 128, 0x1080, 128, MailboxProtocol.COE)


def play(procedure: Procedure[T], answer: Callable[[Request], Reply], *, steps: int = 100_000) -> T:
    """Run a procedure with a function that answers datagrams."""
    now = 0
    try:
        step = next(procedure)
    except StopIteration as stop:
        at_once: T = stop.value
        return at_once
    for _ in range(steps):
        if isinstance(step, After):
            now += round(step.seconds * 1e9)
            replies: list[Reply] = []
        else:
            now += ROUND_TRIP_NS
            replies = [answer(request)._replace(time_ns=now) for request in step]
        try:
            step = procedure.send(replies)
        except StopIteration as stop:
            result: T = stop.value
            return result
    raise AssertionError(f"no end after {steps} steps")


class MailboxDevice:
    """Owner of a simulated mailbox: the controller and the application of a device.

    `respond` returns the answers to a message. `lose_out` has the numbers of the mailbox datagrams
    that are lost before the device receives them, `lose_back` of those that are lost afterwards.
    Reads and writes of the mailbox are counted from 0.
    """

    def __init__(self, respond: Callable[[Mailbox], list[Mailbox]]) -> None:
        self.respond = respond
        self.lose_out: set[int] = set()
        self.lose_back: set[int] = set()
        self.deduplicates = True
        self.repeats = True  # it repeats its last message on request
        self.repeats_first = False  # it repeats a message even if a newer one is waiting
        self.deaf = False  # it does not read its mailbox
        self.next_counter: Callable[[], int] | None = None  # replaces the usual counter, 1 to 7
        self.spoil: Callable[[bytes], bytes] = lambda data: (
            data
        )  # changes the messages of the device
        self.received: list[Mailbox] = []
        self.repeat_requests = 0
        self._queue: deque[bytes] = deque()
        self._in_buffer: bytes | None = None
        self._out_full = False
        self._last_sent: bytes = b""
        self._last_counter = 0
        self._counter = 0
        self._activation = 0x01  # enabled
        self._acknowledged = False
        self.accesses = 0

    def __call__(self, request: Request) -> Reply:
        station, address = request.address & 0xFFFF, request.address >> 16
        assert station == STATION.address
        if address in (LAYOUT.receive_offset, LAYOUT.send_offset):
            number, self.accesses = self.accesses, self.accesses + 1
            assert not request.repeatable
            if number in self.lose_out:
                return Reply(request.data, 0, True)
            reply = self._mailbox(request, address)
            return Reply(request.data, 0, True) if number in self.lose_back else reply
        return self._register(request, address)

    def _mailbox(self, request: Request, address: int) -> Reply:
        if address == LAYOUT.receive_offset:
            assert request.command is EcatCommand.FPWR
            if self._out_full:
                return Reply(request.data, 0)
            self._take(decode_mailbox(request.data))
            return Reply(request.data, 1)
        if self._in_buffer is None:
            return Reply(request.data, 0)
        data, self._in_buffer = self._in_buffer, None
        self._last_sent = data
        self._refill()
        return Reply(data, 1)

    def _take(self, message: Mailbox) -> None:
        if self.deaf:
            self._out_full = True
            return
        if self.deduplicates and message.counter == self._last_counter:
            return
        self._last_counter = message.counter
        self.received.append(message)
        for answer in self.respond(message):
            self.send(answer)

    def send(self, message: Mailbox) -> None:
        """Add a message with the next counter to the queue of the device."""
        self._counter = next_counter(self._counter)
        counter = self._counter if self.next_counter is None else self.next_counter()
        counted = Mailbox(message.type, message.data, counter)
        self._queue.append(self.spoil(counted.encode(LAYOUT.send_size)))
        self._refill()

    def _refill(self) -> None:
        if self._in_buffer is None and self._queue:
            self._in_buffer = self._queue.popleft()

    def _register(self, request: Request, address: int) -> Reply:
        if address == 0x0805:
            return Reply(bytes([0x08 if self._out_full else 0]), 1)
        if address == 0x080D:
            return Reply(bytes([0x08 if self._in_buffer is not None else 0]), 1)
        if address == 0x080E and request.command is EcatCommand.FPRD:
            return Reply(bytes([self._activation]), 1)
        if address == 0x080E:
            toggled = (request.data[0] ^ self._activation) & 0x02
            self._activation = request.data[0]
            self.repeat_requests += toggled != 0
            if self.repeats and toggled:
                self._repeat()
                self._acknowledged = bool(self._activation & 0x02)
            return Reply(request.data, 1)
        if address == 0x080F:
            return Reply(bytes([0x02 if self._acknowledged else 0]), 1)
        raise AssertionError(f"unexpected access to 0x{address:04X}")

    def _repeat(self) -> None:
        if not self._last_sent or (self._in_buffer is not None and not self.repeats_first):
            return  # the requested message is still in the buffer
        if self._in_buffer is not None:
            self._queue.appendleft(self._in_buffer)
        self._in_buffer = self._last_sent


def coe(message: UploadResponse | DownloadResponse | UploadSegment | Abort | object) -> Mailbox:
    return Mailbox(Type.COE, message.encode())  # type: ignore[attr-defined]


class Dictionary:
    """Owner of objects. It answers SDOs: small answers are expedited, large ones segmented."""

    def __init__(self, objects: dict[tuple[int, int], bytes]) -> None:
        self.objects = objects
        self.written: list[tuple[int, int, bytes]] = []
        self._rest = b""
        self._open: tuple[int, int, int] = (0, 0, 0)

    def __call__(self, message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        room = LAYOUT.send_size - 6
        if isinstance(request, UploadRequest):
            place = (request.index, request.subindex)
            data = self.objects.get(place)
            if data is None:
                return [coe(Abort(*place, 0x0602_0000))]
            if len(data) <= 4:
                return [coe(UploadResponse(*place, data, len(data), expedited=True))]
            first, self._rest = data[: room - 10], data[room - 10 :]
            return [coe(UploadResponse(*place, first, len(data)))]
        if isinstance(request, UploadSegmentRequest):
            part, self._rest = self._rest[: room - 3], self._rest[room - 3 :]
            return [coe(UploadSegment(request.toggle, not self._rest, part))]
        if isinstance(request, DownloadRequest):
            self._open = (request.index, request.subindex, request.size)
            return self._write(request.data, coe(DownloadResponse(*self._open[:2])))
        if isinstance(request, DownloadSegment):
            return self._write(
                self._rest + request.data, coe(DownloadSegmentResponse(request.toggle))
            )
        return []

    def _write(self, data: bytes, answer: Mailbox) -> list[Mailbox]:
        index, subindex, size = self._open
        self._rest = data if len(data) < size else b""
        if len(data) >= size:
            self.written.append((index, subindex, data))
        return [answer]


def channel() -> MailboxChannel:
    return MailboxChannel(STATION, LAYOUT)
