"""Server of EoE, ETG.1000.6 §5.7: addresses, frames to the device, and frames of the device."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterable
from ipaddress import IPv4Address

from catenary.virtual.eoe.fragments import Collector, divided, encoded, spoiled
from catenary.virtual.eoe.host import BROADCAST, Host
from catenary.virtual.eoe.options import PAGE, EthernetOptions
from catenary.virtual.mailbox import ERROR_TOO_SHORT
from catenary.virtual.protocols import Surroundings

EOE_PROTOCOL = 2
FRAGMENT, TIME, SET, SET_RESULT, GET, GET_RESULT = 0, 1, 2, 3, 6, 7
LAST = 0x100
SIZES = (6, 4, 4, 4, 4, 32)  # MAC, IP, mask, gateway, name server, name
FIXED_SIZE = sum(SIZES)
UNSUPPORTED, NO_IP_SUPPORT = 0x0002, 0x0201
FRAMES_MAX = 64  # that wait to be sent
WAITING_MAX = 2  # fragments in the mailbox, so that answers of other protocols do not wait long
FLOOD_TYPE = b"\x88\xb5"  # EtherType for local experiments, IEEE 802
PRE_OP, BOOT = 2, 3


class EthernetServer:
    """Ethernet port of one device: its addresses, and the frames that wait."""

    def __init__(self, options: EthernetOptions, surroundings: Surroundings) -> None:
        self._options = options
        self._surroundings = surroundings
        self._frames: deque[bytes] = deque()
        self._parts: deque[bytes] = deque()  # of the frame that is being sent
        self._frame_number = 0
        self._collector = Collector()
        self._floods = False
        self.dropped = 0  # frames that were not sent
        self.fields = [
            bytes.fromhex(options.mac.replace(":", " ")),
            *(_ip_bytes(text) for text in (options.ip, options.mask, options.gateway, options.dns)),
            options.name.encode().ljust(32, b"\0"),
        ]
        self.host = Host(self.send, surroundings.scheduler, options.pages or {"/": PAGE})
        self._configure_host()
        surroundings.mailbox.on_read.append(self._advance)

    def reset(self) -> None:
        """Discard all frames. Called when the mailbox starts."""
        self._frames.clear()
        self._parts.clear()
        self._collector.reset()
        self.host.reset()
        if self._options.flood and not self._floods:
            self._floods = True
            self._flood()

    def serve(self, payload: bytes) -> Iterable[bytes] | int:
        """Return the answers to a message, or the code of a mailbox error."""
        if len(payload) < 4:
            return ERROR_TOO_SHORT
        kind = payload[0] & 0x0F
        if kind == FRAGMENT:
            frame = self._collector.add(payload)
            if frame is not None:
                self.host.receive(frame)
            return []
        if kind == TIME:
            return []
        answers = self._options.addresses
        if kind in (SET, GET) and answers == "silent":
            return []
        if kind in (SET, GET) and answers == "refused":
            return [_result(SET_RESULT, NO_IP_SUPPORT)]
        if kind == SET:
            return self._set(payload[4:])
        if kind == GET:
            return [_result(GET_RESULT, 0) + self._addresses(packed=answers == "packed")]
        return [_result(SET_RESULT, UNSUPPORTED)]

    def send(self, frame: bytes) -> None:
        """Send an Ethernet frame to the MainDevice."""
        if len(self._frames) >= FRAMES_MAX:
            self.dropped += 1
            return
        self._frames.append(frame)
        self._advance()

    def _advance(self) -> None:
        """Put the next fragments into the mailbox."""
        mailbox = self._surroundings.mailbox
        while mailbox.waiting < WAITING_MAX and self._surroundings.state() not in (1, BOOT):
            while not self._parts and self._frames:
                self._divide(self._frames.popleft())
            if not self._parts or not mailbox.send(EOE_PROTOCOL, self._parts[0]):
                return
            self._parts.popleft()

    def _divide(self, frame: bytes) -> None:
        options, number = self._options, self._frame_number
        self._frame_number += 1
        stamped = frame
        if options.time_stamps:
            stamped += struct.pack("<I", self._surroundings.scheduler.now & 0xFFFF_FFFF)
        parts = divided(stamped, self._surroundings.send_room)
        if number % options.faulty_every == 0:
            parts = spoiled(parts, options.fragments)
        self._parts.extend(
            encoded(part, number % 16, time_stamp=options.time_stamps) for part in parts
        )

    def _flood(self) -> None:
        if self._surroundings.state() >= PRE_OP and self._surroundings.state() != BOOT:
            self.send(BROADCAST + self.fields[0] + FLOOD_TYPE + bytes(46))
        self._surroundings.scheduler.after(round(1e9 / self._options.flood), self._flood)

    # -- addresses

    def _set(self, data: bytes) -> list[bytes] | int:
        if len(data) < 4:
            return ERROR_TOO_SHORT
        [flags] = struct.unpack_from("<I", data)
        rest, fixed = data[4:], len(data) - 4 >= FIXED_SIZE
        fields = list(self.fields)
        for bit, size in enumerate(SIZES):
            if flags >> bit & 1:
                if len(rest) < (1 if size == 32 else size):
                    return ERROR_TOO_SHORT
                fields[bit] = rest[:size].ljust(size, b"\0")
            if fixed or flags >> bit & 1:
                rest = rest[size:]
        self.fields = fields
        self._configure_host()
        return [_result(SET_RESULT, 0)]

    def _addresses(self, *, packed: bool) -> bytes:
        present = [any(field) for field in self.fields]
        flags = sum(known << bit for bit, known in enumerate(present))
        fields = [
            field for field, known in zip(self.fields, present, strict=True) if known or not packed
        ]
        return struct.pack("<I", flags) + b"".join(fields)

    def _configure_host(self) -> None:
        self.host.configure(self.fields[0], self.fields[1][::-1])


def _ip_bytes(text: str) -> bytes:
    return IPv4Address(text or "0.0.0.0").packed[::-1]


def _result(kind: int, result: int) -> bytes:
    return struct.pack("<HH", kind | LAST, result)
