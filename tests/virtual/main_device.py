"""Minimal MainDevice, for tests of single datagrams."""

from __future__ import annotations

import struct
from typing import NamedTuple

from catenary.virtual import Segment
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame

MILLISECOND = 1_000_000
STATION = 0x1001  # of the first device

AL_CONTROL, AL_STATUS = 0x0120, 0x0130
SM0, FMMU0 = 0x0800, 0x0600
SII_CONTROL, SII_DATA = 0x0502, 0x0508


class Answer(NamedTuple):
    data: bytes
    working_counter: int
    address: int


class MainDevice:
    """Link to a segment, with a mailbox counter."""

    def __init__(self, segment: Segment) -> None:
        self.segment = segment
        self.link = segment.open_link()
        self._counter = 0

    def exchange(self, command: EcatCommand, adp: int, ado: int, data: bytes) -> Answer:
        return self.exchange_logical(command, (adp & 0xFFFF) | ado << 16, data)

    def exchange_logical(self, command: EcatCommand, address: int, data: bytes) -> Answer:
        self.link.send(encode_frame([Datagram(command, address, data)]))
        assert self.link.wait_until(self.link.now() + 10 * MILLISECOND, True)
        frame = self.link.receive()
        assert frame is not None
        [datagram] = decode_frame(frame).datagrams
        return Answer(datagram.data, datagram.working_counter, datagram.address)

    def read(self, station: int, ado: int, size: int) -> bytes:
        answer = self.exchange(EcatCommand.FPRD, station, ado, bytes(size))
        assert answer.working_counter == 1
        return answer.data

    def write(self, station: int, ado: int, data: bytes) -> int:
        return self.exchange(EcatCommand.FPWR, station, ado, data).working_counter

    def let_pass(self, milliseconds: float) -> None:
        self.link.wait_until(self.link.now() + round(milliseconds * MILLISECOND), False)

    def number_stations(self) -> None:
        for k in range(len(self.segment)):
            self.exchange(EcatCommand.APWR, -k, 0x0010, struct.pack("<H", STATION + k))

    def request(self, station: int, state: int) -> tuple[int, int]:
        """Request `state`, wait, and return (AL status, AL status code)."""
        self.write(station, AL_CONTROL, struct.pack("<H", state))
        self.let_pass(3)
        return self.al_status(station)

    def al_status(self, station: int) -> tuple[int, int]:
        status, code = struct.unpack("<H2xH", self.read(station, AL_STATUS, 6))
        return status, code

    def sync_manager(self, station: int, n: int, start: int, length: int, control: int) -> None:
        self.write(station, SM0 + 8 * n, struct.pack("<HHBBBB", start, length, control, 0, 1, 0))

    def fmmu(self, station: int, n: int, logical: int, bits: tuple[int, int, int], physical: int,
             kind: int) -> None:  # fmt: skip
        """Configure an FMMU. `bits`: length [bytes], start bit, stop bit."""
        length, start, stop = bits
        block = struct.pack("<IHBBHBBB3x", logical, length, start, stop, physical, 0, kind, 1)
        self.write(station, FMMU0 + 16 * n, block)

    def start_mailbox(self, station: int, size: int = 128) -> None:
        self.sync_manager(station, 0, 0x1000, size, 0x26)
        self.sync_manager(station, 1, 0x1000 + size, size, 0x22)
        assert self.request(station, 2) == (2, 0)

    def start_servo(self, station: int, logical: int, *, control: int = 0x64) -> None:
        """Bring a servo to SAFE-OP with the default 13 + 13 bytes, outputs first in the logical
        image. `control`: control byte of SyncManager 2."""
        self.map_servo(station, logical, control=control)
        assert self.request(station, 4) == (4, 0)

    def map_servo(self, station: int, logical: int, *, control: int = 0x64) -> None:
        """Bring a servo to PRE-OP and configure its process data, as for `start_servo`."""
        self.start_mailbox(station)
        self.sync_manager(station, 2, 0x1100, 13, control)
        self.sync_manager(station, 3, 0x2000, 13, 0x20)
        self.fmmu(station, 0, logical, (13, 0, 7), 0x1100, 2)
        self.fmmu(station, 1, logical + 13, (13, 0, 7), 0x2000, 1)

    # -- mailbox ------------------------------------------------------------------------------

    def put(self, station: int, payload: bytes, *, kind: int = 3, size: int = 128) -> int:
        self._counter = self._counter % 7 + 1
        header = struct.pack("<HHBB", len(payload), 0, 0, kind | self._counter << 4)
        return self.write(station, 0x1000, (header + payload).ljust(size, b"\0"))

    def fetch(self, station: int, size: int = 128) -> bytes | None:
        """Return the next answer with its header, or None after 5 ms."""
        for _ in range(25):
            answer = self.exchange(EcatCommand.FPRD, station, 0x1000 + size, bytes(size))
            if answer.working_counter:
                [length] = struct.unpack_from("<H", answer.data)
                return answer.data[: 6 + length]
            self.let_pass(0.2)
        return None

    def ask(self, station: int, payload: bytes, size: int = 128) -> bytes:
        """Send a CoE request and return the payload of the answer."""
        assert self.put(station, payload, size=size) == 1
        answer = self.fetch(station, size)
        assert answer is not None
        assert answer[5] & 0x0F == 3
        return answer[6:]

    def sdo(self, station: int, payload: bytes, size: int = 128) -> bytes:
        """Send an SDO request and return the answer without its CoE header."""
        return self.ask(station, struct.pack("<H", 0x2000) + payload, size)[2:]

    def upload(self, station: int, index: int, subindex: int, size: int = 128) -> bytes | int:
        """Return the bytes of an object, or the abort code."""
        answer = self.sdo(station, struct.pack("<BHB4x", 0x40, index, subindex), size)
        if answer[0] == 0x80:
            return int(struct.unpack_from("<I", answer, 4)[0])
        assert struct.unpack_from("<HB", answer, 1) == (index, subindex)
        if answer[0] & 2:
            return answer[4 : 8 - (answer[0] >> 2 & 3)]
        [total] = struct.unpack_from("<I", answer, 4)
        data, toggle = answer[8:], 0
        while len(data) < total:
            segment = self.sdo(station, struct.pack("<B7x", 0x60 | toggle), size)
            assert segment[0] & 0xF0 == toggle
            unused = segment[0] >> 1 & 7 if len(segment) == 8 else 0
            data += segment[1 : len(segment) - unused]
            assert bool(segment[0] & 1) is (len(data) == total)
            toggle ^= 0x10
        return data

    def download(self, station: int, index: int, subindex: int, data: bytes) -> int:
        """Write an object (expedited or normal). Return 0 or the abort code."""
        if len(data) <= 4:
            head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, subindex)
            answer = self.sdo(station, head + data.ljust(4, b"\0"))
        else:
            head = struct.pack("<BHBI", 0x21, index, subindex, len(data))
            answer = self.sdo(station, head + data)
        return int(struct.unpack_from("<I", answer, 4)[0]) if answer[0] == 0x80 else 0
