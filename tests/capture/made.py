"""Captures made for tests: frames of a master, and the answers of a segment."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import replace

from catenary.capture import Event, EventStream
from catenary.capture.contents import Content
from catenary.wire.coe import Message
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import DEFAULT_SOURCE, encode_frame
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet

STATION = 0x1001
OUT, IN = 0x1000, 0x1080
MAILBOX_SIZE = 128
ANSWER_NS = 20_000
STEP_NS = 1_000_000


def address(adp: int, ado: int) -> int:
    return adp & 0xFFFF | ado << 16


class Conversation:
    """Owner of the packets between a master and a segment. Each exchange takes 1 ms."""

    def __init__(self, source: bytes = DEFAULT_SOURCE) -> None:
        self.packets: list[Packet] = []
        self.time_ns = 1_000_000_000
        self.source = source
        self._index = 0
        self._counter = 0

    def exchange(
        self,
        *datagrams: Datagram,
        answers: Sequence[tuple[bytes | None, int]],
        sent: bool = True,
        returned: bool = True,
    ) -> None:
        """Add a frame and its answer.

        Args:
            *datagrams: What the master sends.
            answers: Data (None: unchanged) and working counter of each datagram that returns.
            sent: False if the capture does not contain the sent frame.
            returned: False if the frame is lost.
        """
        self._index = (self._index + 1) & 0xFF
        numbered = [replace(each, index=self._index) for each in datagrams]
        if sent:
            self._add(self.time_ns, numbered, self.source)
        if returned:
            back = [
                replace(each, data=each.data if data is None else data, working_counter=counter)
                for each, (data, counter) in zip(numbered, answers, strict=True)
            ]
            source = bytes((self.source[0] | 2,)) + self.source[1:]
            self._add(self.time_ns + ANSWER_NS, back, source)
        self.time_ns += STEP_NS

    def _add(self, time_ns: int, datagrams: Iterable[Datagram], source: bytes) -> None:
        self.packets.append(Packet(time_ns, encode_frame(tuple(datagrams), source=source)))

    def write(self, ado: int, data: bytes, *, counter: int = 1, station: int = STATION) -> None:
        """Write registers of a device."""
        datagram = Datagram(EcatCommand.FPWR, address(station, ado), data)
        self.exchange(datagram, answers=[(None, counter)])

    def read(self, ado: int, data: bytes, *, counter: int = 1, station: int = STATION) -> None:
        """Read registers of a device, which answers `data`."""
        datagram = Datagram(EcatCommand.FPRD, address(station, ado), bytes(len(data)))
        self.exchange(datagram, answers=[(data if counter else None, counter)])

    def broadcast(self, command: EcatCommand, ado: int, data: bytes, counter: int) -> None:
        datagram = Datagram(command, address(0, ado), bytes(len(data)))
        if command is EcatCommand.BWR:
            datagram = replace(datagram, data=data)
        self.exchange(datagram, answers=[(data, counter)])

    def mailboxes(self) -> None:
        """Configure the mailboxes of the device."""
        self.write(0x0800, bytes.fromhex("0010800026000100"))
        self.write(0x0808, bytes.fromhex("8010800022000100"))

    def request(self, message: Message | bytes, kind: Type = Type.COE) -> None:
        """Write a mailbox message."""
        self.write(OUT, self._mailbox(message, kind))

    def response(self, message: Message | bytes, kind: Type = Type.COE) -> None:
        """Read a mailbox message."""
        self.read(IN, self._mailbox(message, kind))

    def _mailbox(self, message: Message | bytes, kind: Type) -> bytes:
        self._counter = self._counter % 7 + 1
        data = message if isinstance(message, bytes) else message.encode()
        return Mailbox(kind, data, self._counter).encode(MAILBOX_SIZE)

    def stream(self) -> EventStream:
        return EventStream(io.BytesIO(capture_of(self.packets)).read)

    def events(self) -> list[Event]:
        return list(self.stream())

    def contents(self) -> list[Content]:
        return [event.content for event in self.events()]


def capture_of(packets: Iterable[Packet]) -> bytes:
    """Return a pcapng file."""
    return encode_header("eth0") + b"".join(map(encode_packet, packets))
