"""Simulation of SOEM, as far as its frames differ from those of other masters.

SOEM itself cannot run in virtual time. The module is written from its behaviour
(OpenEtherCATsociety/SOEM, revision b410bf6). Each function names the file and function that it
simulates.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field, replace
from typing import Protocol

from catenary.virtual import Segment
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import SII_CONTROL, STATION, MainDevice

PRE_OP, SAFE_OP, OP, ACKNOWLEDGE = 2, 4, 8, 0x10
FIRST_CATEGORY, GENERAL, SYNC_MANAGERS, END = 0x40, 30, 41, 0xFFFF
FLAGS, BLOCK_LRW = 0x0B, 0x02  # of the general category
OUTPUTS, INPUTS = 3, 4  # SyncManager types
MAX_BUF = 16  # EC_MAXBUF of 1.4 and earlier: index 0 to 15
NO_FRAME = -1

EMPTY, ALLOCATED, SENT, RECEIVED, COMPLETE = range(5)


class SocketLike(Protocol):
    def send(self, frame: bytes, /) -> int: ...

    def receive(self) -> bytes | None:
        """Return the next frame in the socket; None if there is none."""
        ...


@dataclass
class Port:
    """Owns the buffers of oshw/linux/nicdrv.c, one per datagram index."""

    socket: SocketLike
    states: list[int] = field(default_factory=lambda: [EMPTY] * MAX_BUF)
    buffers: list[bytes] = field(default_factory=lambda: [b""] * MAX_BUF)
    last: int = 0

    def exchange(self, frame: bytes, wait: int) -> bytes | None:
        """Send one frame, and receive it within `wait` reads of the socket, which is not drained.

        Simulates ecx_getindex, ecx_outframe, ecx_waitinframe and ecx_setbufstat.
        """
        index = self._index()
        self.states[index] = SENT
        self.socket.send(frame[:17] + bytes([index]) + frame[18:])
        found = any(self._look(index) for _ in range(wait))
        self.states[index] = EMPTY
        return self.buffers[index] if found else None

    def _index(self) -> int:
        """ecx_getindex: the next unused index, modulo 16."""
        index = (self.last + 1) % MAX_BUF
        while self.states[index] != EMPTY:
            index = (index + 1) % MAX_BUF
        self.states[index] = ALLOCATED
        self.last = index
        return index

    def _look(self, index: int) -> bool:
        """ecx_inframe: at most one frame is taken out of the socket."""
        if self.states[index] == RECEIVED:
            return True
        frame = self.socket.receive()
        if frame is None:
            return False
        found = frame[17]
        if found == index or (found < MAX_BUF and self.states[found] == SENT):
            self.buffers[found] = frame
            self.states[found] = COMPLETE if found == index else RECEIVED
        return found == index


@dataclass(frozen=True)
class Record:
    """Part of a device's SII that SOEM keeps."""

    identity: tuple[int, int, int]
    block_lrw: bool
    managers: tuple[bytes, ...]  # 8 bytes each, as in the SII
    mailbox: bool

    def managers_of(self, kind: int) -> list[tuple[int, int, int, int]]:
        """Yield (number, start, length, control) of the SyncManagers of a type."""
        return [
            (n, *struct.unpack_from("<HHB", each))
            for n, each in enumerate(self.managers)
            if each[7] == kind and each[2:4] != b"\0\0"
        ]


class Soem:
    """Simulates ecx_config_init, ecx_config_map_group and the exchange of process data."""

    def __init__(self, segment: Segment) -> None:
        self.main = MainDevice(segment)
        self.records: list[Record] = []
        self.sii_reads = 0
        self.outputs = self.inputs = 0  # bytes
        self.expected = 0

    # -- src/ec_config.c, ecx_config_init

    def scan(self) -> None:
        self.main.number_stations()
        for position in range(len(self.main.segment)):
            station = STATION + position
            self.main.write(station, 0x0120, struct.pack("<H", 1 | ACKNOWLEDGE))
            self.main.let_pass(3)
            identity = tuple(self._words(station, word) for word in (0x08, 0x0A, 0x0C))
            self.records.append(self._lookup(identity) or self._read(station, identity))
            self._start_mailbox(station, self.records[-1])

    def _lookup(self, identity: tuple[int, ...]) -> Record | None:
        """ecx_lookup_prev_sii: devices with the same three numbers share the SII of the first."""
        return next((replace(r) for r in self.records if r.identity == identity), None)

    def _read(self, station: int, identity: tuple[int, ...]) -> Record:
        general = self._category(station, GENERAL)
        managers = self._category(station, SYNC_MANAGERS)
        return Record(
            (identity[0], identity[1], identity[2]),
            bool(general[FLAGS] & BLOCK_LRW),
            tuple(managers[k : k + 8] for k in range(0, len(managers), 8)),
            bool(self._words(station, 0x18) >> 16),
        )

    def _words(self, station: int, word: int) -> int:
        """ecx_readeeprom: two words."""
        self.sii_reads += 1
        self.main.write(station, SII_CONTROL, struct.pack("<BBI", 0, 1, word))
        self.main.let_pass(1)
        return int(struct.unpack_from("<I", self.main.read(station, SII_CONTROL, 10), 6)[0])

    def _category(self, station: int, wanted: int) -> bytes:
        """Return the content of a category (ecx_siifind)."""
        word = FIRST_CATEGORY
        while True:
            kind, size = struct.unpack("<HH", self._words(station, word).to_bytes(4, "little"))
            if kind == END:
                return b""
            if kind == wanted:
                data = (self._words(station, word + 2 + k) for k in range(0, size, 2))
                return b"".join(part.to_bytes(4, "little") for part in data)[: 2 * size]
            word += 2 + size

    def _start_mailbox(self, station: int, record: Record) -> None:
        for n, manager in enumerate(record.managers[:2] if record.mailbox else ()):
            self.main.write(station, 0x0800 + 8 * n, manager[:5] + b"\0\x01\0")
        self.main.write(station, 0x0120, struct.pack("<H", PRE_OP | ACKNOWLEDGE))
        self.main.let_pass(3)

    # -- src/ec_config.c, ecx_config_map_group

    @property
    def blocks_lrw(self) -> bool:
        """True if the SII of any device denies LRW. The features of controllers are ignored."""
        return any(record.block_lrw for record in self.records)

    def map(self) -> None:
        """Map whole bytes, outputs first, with the lengths of the SII."""
        logical = 0
        for kind, direction in ((OUTPUTS, 2), (INPUTS, 1)):
            for position, record in enumerate(self.records):
                fmmu = 0 if kind == OUTPUTS else len(record.managers_of(OUTPUTS))
                for n, start, length, control in record.managers_of(kind):
                    station = STATION + position
                    self.main.sync_manager(station, n, start, length, control)
                    self.main.fmmu(station, fmmu, logical, (length, 0, 7), start, direction)
                    logical += length
                    fmmu += 1
                self.expected += direction * bool(record.managers_of(kind))
            if kind == OUTPUTS:
                self.outputs = logical
        self.inputs = logical - self.outputs

    def to_operational(self) -> list[int]:
        """Request SAFE-OP, send outputs, request OP. Return the AL status of all devices."""
        self._request(SAFE_OP)
        for _ in range(5):
            self.exchange()
            self.main.let_pass(1)
        self._request(OP)
        self.exchange()
        self.main.let_pass(5)
        return [self.main.al_status(STATION + k)[0] for k in range(len(self.records))]

    def _request(self, state: int) -> None:
        self.main.exchange(EcatCommand.BWR, 0, 0x0120, struct.pack("<H", state))
        self.main.let_pass(5)

    # -- src/ec_main.c, ecx_main_send_processdata and ecx_receive_processdata_group

    def exchange(self) -> int:
        """Return the working counter as SOEM counts it: an LWR counts twice, like an LRW."""
        if not self.blocks_lrw:
            image = bytes(self.outputs + self.inputs)
            return self.main.exchange_logical(EcatCommand.LRW, 0, image).working_counter
        read = self.main.exchange_logical(EcatCommand.LRD, self.outputs, bytes(self.inputs))
        written = self.main.exchange_logical(EcatCommand.LWR, 0, bytes(self.outputs))
        return read.working_counter + 2 * written.working_counter
