"""Gateway service: one thread for all sockets, which passes messages to the router.

Theory of operation. The thread runs in passes, with a PAUSE after each, so that clients cannot take
the interpreter from the program. A pass accepts at most ACCEPTED connections, receives at most
DATAGRAMS datagrams and one message of each connection, and sends the answers of the workers.

TCP messages beyond the limits of a client wait in its socket, and the client then blocks. UDP
messages beyond them are dropped. A connection that sends garbage is closed, because the next frame
cannot be found.
"""

from __future__ import annotations

import logging
import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TypeAlias

from catenary.bus.thread_priority import leave_real_time
from catenary.errors import DecodeError
from catenary.gateway.clients import Client, TcpClient, UdpClient
from catenary.gateway.limits import CLIENTS, CLOSE_TIMEOUT, GatewayCounts
from catenary.gateway.sockets import Sockets
from catenary.wire.gateway import MAXIMUM_SIZE, decode_gateway, encode_gateway
from catenary.wire.mailbox import ErrorCode, ErrorReply, Mailbox, Type

log = logging.getLogger("catenary.gateway")

PAUSE = 0.001  # [s] between two passes
SOON = 0.005  # [s] between two passes while a message waits for its rate limit
IDLE = 0.2  # [s] between two passes without messages
ACCEPTED = DATAGRAMS = 16

Receiver: TypeAlias = Callable[[Client, Mailbox], None]


class Service:
    """Owner of the sockets, the clients and the thread."""

    def __init__(
        self,
        sockets: Sockets,
        counts: GatewayCounts,
        receive: Receiver,
        leave: Callable[[Client], None],
        sweep: Callable[[], None],
    ) -> None:
        """Initialise the service.

        Args:
            sockets: Listening sockets, which the service closes.
            counts: Counters to update.
            receive: Function that receives each message. It calls `answer` exactly once.
            leave: Function that is called for each client that has gone.
            sweep: Function that is called after each pass.
        """
        self._sockets = sockets
        self._counts = counts
        self._receive = receive
        self._leave = leave
        self._sweep = sweep
        self._tcp: list[TcpClient] = []
        self._udp: dict[tuple[str, int], UdpClient] = {}
        self._answers: deque[tuple[Client, list[Mailbox]]] = deque()
        self._ended = threading.Event()
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._wake_lock = threading.Lock()  # no write to the number of a closed file
        self._thread = threading.Thread(target=self._serve, name="catenary gateway", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Disconnect all clients, and end the thread."""
        with self._wake_lock:
            self._ended.set()
            os.eventfd_write(self._wake, 1)
        self._thread.join(CLOSE_TIMEOUT)
        if not self._thread.is_alive():
            os.close(self._wake)

    @property
    def clients(self) -> tuple[str, ...]:
        """Present clients, such as "TCP 127.0.0.1:50000"."""
        return tuple(str(client) for client in (*self._tcp, *tuple(self._udp.values())))

    def answer(self, client: Client, answers: list[Mailbox]) -> None:
        """Queue the answers to one message. Any thread may call this.

        Args:
            client: The client.
            answers: Answers; empty if the message has none.
        """
        self._answers.append((client, answers))
        with self._wake_lock:
            if not self._ended.is_set():
                os.eventfd_write(self._wake, 1)

    def _serve(self) -> None:
        leave_real_time()
        try:
            while not self._ended.is_set():
                self._pass(self._poll())
                self._ended.wait(PAUSE)
        except Exception:  # a thread has no caller
            log.exception("the gateway has ended; close it, and open it again")
        finally:
            for client in self._tcp:
                client.close()
            self._sockets.close()

    def _poll(self) -> dict[int, int]:
        """Wait for messages, and return the events of each socket."""
        now = time.monotonic()
        poll = select.poll()
        for number in (self._wake, self._sockets.tcp.fileno(), self._sockets.udp.fileno()):
            poll.register(number, select.POLLIN)
        timeout = IDLE
        for client in self._tcp:
            wants = client.wants(now)
            if client.is_full and not wants:
                timeout = SOON
            elif client.is_full:
                timeout = 0.0
            events = select.POLLIN * (wants and not client.is_full)
            poll.register(client.fileno(), events | select.POLLOUT * client.has_mail)
        return dict(poll.poll(timeout * 1000))

    def _pass(self, ready: dict[int, int]) -> None:
        now = time.monotonic()
        if self._wake in ready:
            os.eventfd_read(self._wake)
        self._send_answers(now)
        if self._sockets.tcp.fileno() in ready:
            self._accept(now)
        if self._sockets.udp.fileno() in ready:
            self._receive_datagrams(now)
        for client in self._tcp:
            self._serve_client(client, ready.get(client.fileno(), 0), now)
        for client in [client for client in self._tcp if not client.open]:
            self._tcp.remove(client)
            self._leave(client)
        self._sweep()

    def _send_answers(self, now: float) -> None:
        for _ in range(len(self._answers)):
            client, answers = self._answers.popleft()
            client.outstanding -= 1
            for answer in answers:
                if client.open:
                    client.send(_encoded(answer), now)

    def _accept(self, now: float) -> None:
        for _ in range(ACCEPTED):
            try:
                connected, peer = self._sockets.tcp.accept()
            except OSError:  # none is left, or it has gone
                return
            self._counts.connections += 1
            if len(self._tcp) >= CLIENTS:
                self._counts.rejected += 1
                connected.close()
                continue
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._tcp.append(TcpClient(connected, peer[:2], now))

    def _serve_client(self, client: TcpClient, events: int, now: float) -> None:
        """Receive and begin at most one message of a connection, and send to it."""
        if events & select.POLLOUT:
            client.flush(now)
        if events & (select.POLLIN | select.POLLHUP | select.POLLERR):
            client.receive(now)
        if not client.open:
            return
        try:
            message = client.next_message(now) if client.wants(now) else None
        except DecodeError as error:
            self._counts.invalid += 1
            return self._disconnect(client, error.message)
        if message is not None:
            self._begin(client, message)
        if client.is_late(now):
            self._disconnect(client, "it does not read, does not complete its frame, or is silent")

    def _disconnect(self, client: TcpClient, why: str) -> None:
        self._counts.disconnected += 1
        log.debug("%s disconnected: %s", client, why)
        client.close()

    def _receive_datagrams(self, now: float) -> None:
        for _ in range(DATAGRAMS):
            try:
                data, address = self._sockets.udp.recvfrom(MAXIMUM_SIZE + 1)
            except OSError:  # none is left, or an answer could not be delivered
                return
            try:
                message = decode_gateway(data)
            except DecodeError:
                self._counts.invalid += 1
                continue
            client = self._udp_client(address[:2], now)
            if client is None or not client.accepts(now):
                self._counts.dropped += 1
            else:
                self._begin(client, message)

    def _udp_client(self, address: tuple[str, int], now: float) -> UdpClient | None:
        """Return the client with an address. A new one replaces the longest idle one."""
        if address in self._udp:
            return self._udp[address]
        if len(self._udp) >= CLIENTS:
            idle = [client for client in self._udp.values() if not client.outstanding]
            if not idle:
                return None
            oldest = min(idle, key=lambda client: client.last)
            del self._udp[oldest.address]
            self._leave(oldest)
        client = self._udp[address] = UdpClient(self._sockets.udp, address, now)
        return client

    def _begin(self, client: Client, message: Mailbox) -> None:
        self._counts.requests += 1
        client.outstanding += 1
        self._receive(client, message)


def _encoded(answer: Mailbox) -> bytes:
    """Return the frame of an answer; that of a mailbox error if the answer is too long."""
    try:
        return encode_gateway(answer)
    except ValueError:
        error = ErrorReply(ErrorCode.INVALID_SIZE).encode()
        return encode_gateway(Mailbox(Type.ERROR, error, answer.counter, answer.address))
