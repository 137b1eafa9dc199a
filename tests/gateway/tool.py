"""A tool of a vendor: a client of the gateway, written from ETG.8200 and ETG.1000.6 alone.

It uses nothing of Catenary.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from typing import NamedTuple, Self

ERROR, AOE, EOE, COE, FOE, SOE, VOE = 0, 1, 2, 3, 4, 5, 15
TIMEOUT = 60.0  # [s] for a machine under load; an answer takes milliseconds


class Answer(NamedTuple):
    address: int
    kind: int
    counter: int
    data: bytes


class Aborted(Exception):
    """The answer was an SDO abort, an FoE error or a mailbox error."""

    def __init__(self, kind: int, code: int) -> None:
        super().__init__(f"0x{code:X}")
        self.kind, self.code = kind, code


class Tool:
    """Connection to a gateway, by TCP or UDP."""

    def __init__(self, port: int, *, udp: bool = False, address: int = 0x1002) -> None:
        self.udp, self.address = udp, address
        self.counter = 0
        self.sent: list[bytes] = []
        self.received: list[bytes] = []
        kind = socket.SOCK_DGRAM if udp else socket.SOCK_STREAM
        self.socket = socket.socket(socket.AF_INET, kind)
        self.socket.settimeout(TIMEOUT)
        self.socket.connect(("127.0.0.1", port))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    @property
    def peer(self) -> str:
        host, port = self.socket.getsockname()
        return f"{'UDP' if self.udp else 'TCP'} {host}:{port}"

    def send(self, kind: int, data: bytes) -> None:
        self.counter = self.counter % 7 + 1
        mailbox = struct.pack("<HHBB", len(data), self.address, 0, kind | self.counter << 4) + data
        self.sent.append(struct.pack("<H", len(mailbox) | 5 << 12) + mailbox)
        self.socket.sendall(self.sent[-1])

    def receive(self) -> Answer:
        if self.udp:
            frame = self.socket.recv(4096)
        else:
            frame = self._exactly(2)
            frame += self._exactly(struct.unpack("<H", frame)[0] & 0x7FF)
        self.received.append(frame)
        header, length, address, channel, kind = struct.unpack_from("<HHHBB", frame)
        assert header >> 12 == 5
        assert header & 0x7FF == length + 6 == len(frame) - 2
        assert channel == 0
        return Answer(address, kind & 15, kind >> 4, frame[8:])

    def _exactly(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            if not part:
                raise ConnectionError("the gateway has closed the connection")
            data += part
        return data

    def ask(self, kind: int, data: bytes) -> Answer:
        self.send(kind, data)
        answer = self.receive()
        assert (answer.address, answer.counter) == (self.address, self.counter)
        if answer.kind == ERROR:
            raise Aborted(ERROR, struct.unpack("<HH", answer.data)[1])
        assert answer.kind == kind
        if kind == COE and answer.data[2] >> 5 == 4 and answer.data[1] >> 4 in (2, 3):
            raise Aborted(COE, int.from_bytes(answer.data[6:10], "little"))
        if kind == FOE and answer.data[0] == 5:
            raise Aborted(FOE, int.from_bytes(answer.data[2:6], "little"))
        return answer

    # CoE

    def upload(self, index: int, subindex: int = 0) -> bytes:
        data = self.ask(COE, struct.pack("<HBHB4x", 0x2000, 0x40, index, subindex)).data
        command, size = data[2], int.from_bytes(data[6:10], "little")
        assert data[3:6] == struct.pack("<HB", index, subindex)
        if command & 2:
            return data[6 : 10 - (command >> 2 & 3)]
        value, toggle = data[10:], 0
        while len(value) < size:
            segment = self.ask(COE, struct.pack("<HB7x", 0x2000, 0x60 | toggle)).data
            padding = segment[2] >> 1 & 7 if len(segment) == 10 else 0
            value += segment[3 : len(segment) - padding]
            toggle ^= 0x10
        return value

    def download(self, index: int, subindex: int, value: bytes, *, complete: bool = False) -> None:
        command = 0x23 | (4 - len(value)) << 2 | complete << 4
        head = struct.pack("<HBHB", 0x2000, command, index, subindex)
        self.ask(COE, head + value.ljust(4, b"\0"))

    def begin_download(self, index: int, subindex: int, size: int, complete: bool = False) -> None:
        """Announce an object of which all data follows in segments."""
        head = struct.pack("<HBHBI", 0x2000, 0x21 | complete << 4, index, subindex, size)
        self.ask(COE, head)

    def segment(self, value: bytes, *, toggle: int = 0, last: bool = False) -> None:
        command = toggle << 4 | (7 - min(len(value), 7)) << 1 | last
        self.ask(COE, struct.pack("<HB", 0x2000, command) + value.ljust(7, b"\0"))

    def object_list(self) -> list[int]:
        self.send(COE, struct.pack("<HBxHH", 0x8000, 1, 0, 1))
        data, more = b"", True
        while more:
            part = self.receive().data
            assert part[2] & 0x7F == 2
            data, more = data + part[6:], bool(part[2] & 0x80)
        return [index for (index,) in struct.iter_unpack("<H", data[2:])]

    # FoE

    def file_packets(self, name: str, full: int) -> Iterator[bytes]:
        packet = self.ask(FOE, struct.pack("<BxI", 1, 0) + name.encode())
        while True:
            assert packet.data[0] == 3
            yield packet.data[6:]
            acknowledge = struct.pack("<BxI", 4, int.from_bytes(packet.data[2:6], "little"))
            if len(packet.data) - 6 < full:
                return self.send(FOE, acknowledge)
            packet = self.ask(FOE, acknowledge)

    def read_file(self, name: str, full: int = 128 - 12) -> bytes:
        return b"".join(self.file_packets(name, full))

    def write_file(self, name: str, data: bytes, full: int = 128 - 12) -> None:
        assert self.ask(FOE, struct.pack("<BxI", 2, 0) + name.encode()).data[0] == 4
        for number, start in enumerate(range(0, len(data) + 1, full), 1):
            packet = struct.pack("<BxI", 3, number) + data[start : start + full]
            assert self.ask(FOE, packet).data[0] == 4
