"""Server of FoE, ETG.1000.6 §5.8: one transfer at a time, in the states of §5.8.8.

The code is independent of the codec `catenary.wire.foe`, so that each tests the other.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import Enum, auto

from catenary.virtual.foe.store import FileStore, Refusal

HEADER = struct.Struct("<BxI")
BUSY_HEADER = struct.Struct("<BxHH")
RRQ, WRQ, DATA, ACK, ERR, BUSY = 1, 2, 3, 4, 5, 6
ILLEGAL, WRONG_PACKET = 0x8004, 0x8005
TEXTS = {
    0x8001: "file not found",
    0x8002: "access denied",
    0x8003: "disk full",
    0x8004: "illegal",
    0x8005: "wrong packet number",
    0x8008: "bootstrap only",
    0x8009: "not in bootstrap",
    0x800A: "no rights",
    0x800C: "wrong checksum",
    0x800D: "wrong product",
    0x8010: "no firmware header",
}


class State(Enum):
    """State of the server."""

    IDLE = auto()
    WRITING = auto()  # waits for data
    READING = auto()  # waits for an acknowledgement
    LAST_SENT = auto()  # waits for the acknowledgement of the last packet


class FileServer:
    """Transfer in progress, and the answers of the device."""

    def __init__(
        self, store: FileStore, *, rooms: Callable[[], tuple[int, int]], boot: Callable[[], bool]
    ) -> None:
        """Initialise the server.

        Args:
            store: Files of the device.
            rooms: Function that returns the maximum data of a packet to and from the device.
            boot: Function that returns True in BOOT.
        """
        self._store = store
        self._rooms = rooms
        self._boot = boot
        self.reset()

    def reset(self) -> None:
        """Forget a transfer. Called on entry to PRE-OP and BOOT."""
        self._state = State.IDLE
        self._name = ""
        self._data = bytearray()  # received so far, or all of the file to send
        self._packet = 0  # number of the last packet
        self._busy = self._store.options.busy

    def serve(self, payload: bytes) -> list[bytes]:
        """Return the answers to a message of at least 6 bytes."""
        code, number = HEADER.unpack_from(payload)
        rest = payload[HEADER.size :]
        try:
            if self._busy and code in (RRQ, WRQ, DATA, ACK) and self._state is not State.LAST_SENT:
                if code == RRQ and self._store.options.after_busy == "acknowledgement":
                    self._begin_busy_read(rest, number)
                return [self._busy_answer()]
            self._busy = self._store.options.busy
            return self._answer(code, number, rest)
        except Refusal as refusal:
            self.reset()
            return [self._error(refusal.code)]

    def _begin_busy_read(self, rest: bytes, password: int) -> None:
        """Open a file. Acknowledgement 0 then requests its first packet."""
        if self._state is not State.IDLE:
            raise Refusal(ILLEGAL)
        self._data = bytearray(self._store.read(_name(rest), password, boot=self._boot()))
        self._state = State.READING

    def _busy_answer(self) -> bytes:
        entire = min(self._store.options.busy, 0xFFFF)
        done = entire - min(self._busy, entire)
        self._busy -= 1
        return BUSY_HEADER.pack(BUSY, done, entire) + b"busy"

    def _answer(self, code: int, number: int, rest: bytes) -> list[bytes]:
        if code in (RRQ, WRQ):
            return self._open(code, _name(rest), number)
        if code == DATA and self._state is State.WRITING:
            return self._take(number, rest)
        if code == ACK and self._state in (State.READING, State.LAST_SENT):
            return self._acknowledged(number)
        if code == BUSY and self._packet and self._state in (State.READING, State.LAST_SENT):
            return [self._packet_answer()]
        if code == ERR:
            self.reset()
            return []
        raise Refusal(ILLEGAL)

    def _open(self, code: int, name: str, password: int) -> list[bytes]:
        options = self._store.options
        if self._state is not State.IDLE and options.second_request == "refused":
            raise Refusal(ILLEGAL)
        boot = self._boot()
        self.reset()
        self._name = name
        if code == WRQ:
            self._store.begin(name, password, boot=boot)
            self._state = State.WRITING
            return [HEADER.pack(ACK, 0)]
        self._data = bytearray(self._store.read(name, password, boot=boot))
        self._packet = 1
        return [self._packet_answer()]

    def _take(self, number: int, data: bytes) -> list[bytes]:
        if number != self._packet + 1:
            raise Refusal(WRONG_PACKET)
        self._store.check_size(self._name, len(self._data) + len(data))
        self._data += data
        self._packet = number
        if len(data) < self._rooms()[0]:
            self._store.finish(self._name, bytes(self._data))
            self.reset()
        return [HEADER.pack(ACK, number)]

    def _acknowledged(self, number: int) -> list[bytes]:
        if number != self._packet:
            raise Refusal(WRONG_PACKET)
        if self._state is State.LAST_SENT:
            self.reset()
            return []
        self._packet += 1
        return [self._packet_answer()]

    def _packet_answer(self) -> bytes:
        room = self._rooms()[1]
        start = (self._packet - 1) * room
        part = bytes(self._data[start : start + room])
        self._state = State.READING if len(part) == room else State.LAST_SENT
        return HEADER.pack(DATA, self._packet) + part

    def _error(self, code: int) -> bytes:
        text = TEXTS.get(code, "") if self._store.options.error_texts else ""
        return HEADER.pack(ERR, code) + text.encode()


def _name(rest: bytes) -> str:
    return rest.split(b"\0", 1)[0].decode("latin-1")
