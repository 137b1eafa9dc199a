"""Small TCP server (RFC 9293) for the web pages of a virtual device.

It only accepts connections, keeps data in order, and sends lost data again from the first missing
byte on. It is not meant for any other network than that of a virtual device.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

from catenary.virtual.eoe.checksum import checksum
from catenary.virtual.eoe.web import answer
from catenary.virtual.scheduler import Scheduler

HEADER = struct.Struct("!HHIIBBHHH")
FIN, SYN, RST, PSH, ACK = 0x01, 0x02, 0x04, 0x08, 0x10
HTTP_PORT = 80
CONNECTIONS_MAX = 16
SEGMENT_MAX = 1460  # data [bytes]
SEGMENT_OPTION = struct.pack("!BBH", 2, 4, SEGMENT_MAX)
WINDOW = 0x4000  # that the server announces [bytes]
UNDER_WAY_MAX = 8 * SEGMENT_MAX  # [bytes] that are not acknowledged; more would be a long burst
RESEND_NS, RESENDS_MAX = 300_000_000, 10
DUPLICATES = 3  # equal acknowledgements that show a loss
SEQUENCE = 1 << 32

SendSegment: TypeAlias = Callable[[bytes, bytes, bytes], None]  # MAC, IP address, segment


class Segment(NamedTuple):
    """Header fields and data of a received segment."""

    port: int  # of the peer
    sequence: int
    acknowledged: int
    flags: int
    window: int
    data: bytes


class Peer(NamedTuple):
    """Addresses of a connection."""

    mac: bytes
    ip: bytes
    port: int
    own_ip: bytes


class Connection:
    """Owner of the data of one connection. All offsets count from the first byte of the answer."""

    def __init__(
        self, peer: Peer, first: Segment, start: int, send: SendSegment, pages: Mapping[str, str]
    ) -> None:
        self._peer = peer
        self._send_segment = send
        self._pages = pages
        self._start = start  # sequence number of the SYN
        self._next = (first.sequence + 1) % SEQUENCE  # expected from the peer
        self._request = b""
        self._answer: bytes | None = None  # None: the request is not complete
        self._acked = 0  # bytes; the FIN counts as one
        self._sent = 0
        self._window = first.window
        self._duplicates = 0
        self._established = False
        self.peer_ended = False
        self.resends = 0
        self.acked_at_timer = -1
        self._send(SYN | ACK, sequence=start, options=SEGMENT_OPTION)

    @property
    def ended(self) -> bool:
        """True if the answer and its end were acknowledged."""
        return self._answer is not None and self._acked > len(self._answer)

    @property
    def waits(self) -> bool:
        """True if the peer has to acknowledge something."""
        return not self._established or self._sent > self._acked

    def receive(self, segment: Segment) -> None:
        """Process a segment of the peer."""
        if segment.flags & SYN:
            self._send(SYN | ACK, sequence=self._start, options=SEGMENT_OPTION)
            return
        if segment.flags & ACK:
            self._note_acknowledged(segment)
        if segment.data or segment.flags & FIN:
            self._take(segment)
        self._send_more()

    def resend(self) -> None:
        """Send again from the first byte that was not acknowledged."""
        self.resends += 1
        if not self._established:
            self._send(SYN | ACK, sequence=self._start, options=SEGMENT_OPTION)
            return
        self._sent = self._acked
        self._send_more()

    def _note_acknowledged(self, segment: Segment) -> None:
        offset = (segment.acknowledged - self._start - 1) % SEQUENCE
        self._window = segment.window
        if offset > self._limit:
            return  # an older or invalid acknowledgement
        self._established = True
        if offset > self._acked:
            self._acked, self.resends, self._duplicates = offset, 0, 0
            self._sent = max(self._sent, offset)
        elif offset == self._acked and self._sent > self._acked and not segment.data:
            self._duplicates += 1
            if self._duplicates == DUPLICATES:
                self._sent = self._acked

    @property
    def _limit(self) -> int:
        """Number of bytes of the answer and its FIN."""
        return 0 if self._answer is None else len(self._answer) + 1

    def _take(self, segment: Segment) -> None:
        if segment.sequence == self._next and not self.peer_ended:
            self._request += segment.data
            self._next = (self._next + len(segment.data)) % SEQUENCE
            if segment.flags & FIN:
                self._next = (self._next + 1) % SEQUENCE
                self.peer_ended = True
            if self._answer is None:
                self._answer = answer(self._request, self._pages)
                if self._answer is None and self.peer_ended:
                    self._answer = b""
        self._send(ACK)

    def _send_more(self) -> None:
        """Send as much of the answer as the windows allow, and its end."""
        if self._answer is None:
            return
        end = min(len(self._answer), self._acked + min(self._window, UNDER_WAY_MAX))
        while self._sent < end:
            data = self._answer[self._sent : min(self._sent + SEGMENT_MAX, end)]
            self._send(ACK | PSH, data)
            self._sent += len(data)
        if self._sent == len(self._answer):
            self._send(ACK | FIN)
            self._sent += 1

    def _send(
        self, flags: int, data: bytes = b"", *, sequence: int | None = None, options: bytes = b""
    ) -> None:
        number = (self._start + 1 + self._sent) % SEQUENCE if sequence is None else sequence
        segment = encode(self._peer, number, self._next, flags, options, data)
        self._send_segment(self._peer.mac, self._peer.ip, segment)


class TcpServer:
    """Owner of the connections of a device."""

    def __init__(self, send: SendSegment, scheduler: Scheduler, pages: Mapping[str, str]) -> None:
        """Initialise the server.

        Args:
            send: Function that sends a segment to a MAC address and an IP address.
            scheduler: Delayed actions of the device.
            pages: Web pages by path.
        """
        self._send = send
        self._scheduler = scheduler
        self._pages = pages
        self._connections: dict[tuple[bytes, int], Connection] = {}
        self._start = 0
        self._timer_runs = False

    def reset(self) -> None:
        """Forget all connections."""
        self._connections.clear()

    def receive(self, mac: bytes, ip: bytes, own_ip: bytes, data: bytes) -> None:
        """Process a segment.

        Args:
            mac: MAC address of the peer.
            ip: IP address of the peer.
            own_ip: IP address of the device.
            data: The segment with its header.
        """
        decoded = decode(ip, own_ip, data)
        if decoded is None:
            return
        port, segment = decoded
        key = ip, segment.port
        peer = Peer(mac, ip, segment.port, own_ip)
        if segment.flags & RST:
            self._connections.pop(key, None)
        elif key in self._connections:
            self._connections[key].receive(segment)
            if self._connections[key].ended:
                del self._connections[key]
        elif port == HTTP_PORT and segment.flags & (SYN | ACK) == SYN:
            self._accept(key, peer, segment)
        elif segment.flags & SYN or port != HTTP_PORT:
            self._refuse(peer, port, segment)
        elif segment.flags & FIN:  # of a connection that has ended here
            reply = encode(
                peer, segment.acknowledged, segment.sequence + len(segment.data) + 1, ACK
            )
            self._send(mac, ip, reply)
        self._run_timer()

    def _accept(self, key: tuple[bytes, int], peer: Peer, segment: Segment) -> None:
        if len(self._connections) >= CONNECTIONS_MAX:
            self._connections.pop(next(iter(self._connections)))  # the oldest one
        self._start = (self._start + 64_000) % SEQUENCE
        self._connections[key] = Connection(peer, segment, self._start, self._send, self._pages)

    def _refuse(self, peer: Peer, port: int, segment: Segment) -> None:
        after = segment.sequence + len(segment.data) + bool(segment.flags & SYN)
        reply = encode(peer, segment.acknowledged, after, RST | ACK, own_port=port)
        self._send(peer.mac, peer.ip, reply)

    def _run_timer(self) -> None:
        if self._connections and not self._timer_runs:
            self._timer_runs = True
            self._scheduler.after(RESEND_NS, self._check)

    def _check(self) -> None:
        """Send again what was not acknowledged since the last check."""
        self._timer_runs = False
        for key, connection in list(self._connections.items()):
            if connection.resends > RESENDS_MAX:
                del self._connections[key]
            elif connection.waits and connection.acked_at_timer == connection._acked:
                connection.resend()
            connection.acked_at_timer = connection._acked
        self._run_timer()


def encode(
    peer: Peer,
    sequence: int,
    acknowledged: int,
    flags: int,
    options: bytes = b"",
    data: bytes = b"",
    *,
    own_port: int = HTTP_PORT,
) -> bytes:
    """Return a segment with its checksum.

    Args:
        peer: Addresses of the connection.
        sequence: Sequence number of the first byte.
        acknowledged: Next expected sequence number.
        flags: Flags of the header.
        options: Options, a multiple of 4 bytes.
        data: Data after the header.
        own_port: Port of the device.
    """
    size = HEADER.size + len(options)
    fields = (own_port, peer.port, sequence % SEQUENCE, acknowledged % SEQUENCE, size << 2, flags)
    rest = options + data
    pseudo = peer.own_ip + peer.ip + struct.pack("!HH", 6, size + len(data))
    value = checksum(pseudo + HEADER.pack(*fields, WINDOW, 0, 0) + rest)
    return HEADER.pack(*fields, WINDOW, value, 0) + rest


def decode(ip: bytes, own_ip: bytes, data: bytes) -> tuple[int, Segment] | None:
    """Return the destination port and the segment; None if it is not valid.

    Args:
        ip: IP address of the peer.
        own_ip: IP address of the device.
        data: The segment.
    """
    if len(data) < HEADER.size or checksum(ip + own_ip + struct.pack("!HH", 6, len(data)) + data):
        return None
    source, port, sequence, acknowledged, offset, flags, window, _, _ = HEADER.unpack_from(data)
    size = offset >> 4 << 2
    if not HEADER.size <= size <= len(data):
        return None
    return port, Segment(source, sequence, acknowledged, flags, window, data[size:])
