"""Clients of the gateway: connections of TCP, and addresses of UDP. Nothing here blocks."""

from __future__ import annotations

import socket
from collections import deque
from contextlib import suppress
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.gateway.limits import (
    BURST,
    FRAME_TIMEOUT,
    IDLE_TIMEOUT,
    OUTBOX_MAX,
    OUTSTANDING,
    RATE,
    STALL_TIMEOUT,
)
from catenary.remote.limits import RateLimit
from catenary.wire.gateway import MAXIMUM_SIZE, decode_gateway, frame_size
from catenary.wire.mailbox import Mailbox

CHUNK = 4096  # [bytes] received at once
SEND_BUFFER = 32 << 10  # [bytes] of the kernel, for answers that a client has not read


class UdpClient:
    """Client that sends datagrams from one address."""

    def __init__(self, server: socket.socket, address: tuple[str, int], now: float) -> None:
        self.open = True
        self.outstanding = 0  # requests without an answer
        self.limit = RateLimit(RATE, BURST)
        self.last = now  # time of the last datagram [s]
        self.address = address
        self._server = server

    def __str__(self) -> str:
        return f"UDP {self.address[0]}:{self.address[1]}"

    def accepts(self, now: float) -> bool:
        """Return True if the limits allow another request, and count it.

        Args:
            now: Present time [s].
        """
        self.last = now
        return self.outstanding < OUTSTANDING and self.limit.wait_for(now) == 0

    def send(self, frame: bytes, _: float) -> None:
        """Send a frame. It is lost if the socket is full, as UDP permits."""
        with suppress(OSError):
            self._server.sendto(frame, self.address)


class TcpClient:
    """Owner of one connection, and of its received and unsent bytes."""

    def __init__(self, connected: socket.socket, peer: tuple[str, int], now: float) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self.open = True
        self.outstanding = 0  # requests without an answer
        self._socket = connected
        self._peer = peer
        self._limit = RateLimit(RATE, BURST)
        self._inbox = bytearray()
        self._outbox: deque[bytes] = deque()
        self._unsent = 0  # [bytes]
        self._last = now  # time of the last received bytes [s]
        self._begun = now  # time at which the first waiting byte was received [s]
        self._allowed = now  # time from which a further message is accepted [s]
        self._stalled: float | None = None  # time since which the client has not read [s]

    def __str__(self) -> str:
        return f"TCP {self._peer[0]}:{self._peer[1]}"

    def fileno(self) -> int:
        return self._socket.fileno()

    def wants(self, now: float) -> bool:
        """Return True if the limits allow another request. Otherwise, its bytes wait.

        Args:
            now: Present time [s].
        """
        free = self.outstanding < OUTSTANDING and now >= self._allowed
        return free and not self._outbox  # a client that does not read need not ask

    @property
    def is_full(self) -> bool:
        """True if no more bytes are needed: a complete frame waits, or bytes that are not one."""
        try:
            size = frame_size(self._inbox)
        except DecodeError:
            return True
        return size is not None and size <= len(self._inbox)

    @property
    def has_mail(self) -> bool:
        """True if bytes wait to be sent."""
        return self.open and bool(self._outbox)

    def receive(self, now: float) -> None:
        """Receive bytes, unless enough wait. The end of the stream closes the connection.

        Args:
            now: Present time [s].
        """
        if len(self._inbox) >= MAXIMUM_SIZE:
            return
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.close()
        self._begun = self._begun if self._inbox else now
        self._inbox += data
        self._last = now

    def next_message(self, now: float) -> Mailbox | None:
        """Return the next message; None if none is complete, or its rate limit is reached.

        Args:
            now: Present time [s].

        Raises:
            DecodeError: The bytes are not a frame. The stream cannot continue.
        """
        size = frame_size(self._inbox)
        if size is None or size > len(self._inbox):
            return None
        wait = self._limit.wait_for(now)
        if wait > 0:
            self._allowed = now + wait
            return None
        frame = bytes(self._inbox[:size])
        del self._inbox[:size]
        self._begun = now
        return decode_gateway(frame)

    def is_late(self, now: float) -> bool:
        """Return True if the client is silent, does not read, or does not complete a frame.

        Args:
            now: Present time [s].
        """
        if self._stalled is not None and now - self._stalled > STALL_TIMEOUT:
            return True
        if not self.wants(now):
            self._begun = now  # the gateway does not receive the rest of a frame in the meantime
        if self._inbox and not self.is_full:
            return now - self._begun > FRAME_TIMEOUT
        return self.outstanding == 0 and now - self._last > IDLE_TIMEOUT

    def send(self, frame: bytes, now: float) -> None:
        """Queue a frame, and send what the client has room for.

        Args:
            frame: The frame.
            now: Present time [s].
        """
        self._outbox.append(frame)
        self._unsent += len(frame)
        self.flush(now)
        if self._unsent > OUTBOX_MAX:
            self.close()

    def flush(self, now: float) -> None:
        """Send queued bytes.

        Args:
            now: Present time [s].
        """
        try:
            while self.has_mail:
                sent = self._socket.send(self._outbox[0])
                self._unsent -= sent
                rest = self._outbox.popleft()[sent:]
                if rest:
                    self._outbox.appendleft(rest)
                self._stalled = None
        except BlockingIOError:
            self._stalled = self._stalled or now
        except OSError:
            self.close()

    def close(self) -> None:
        """End the connection."""
        if self.open:
            self.open = False
            self._socket.close()


Client: TypeAlias = TcpClient | UdpClient
