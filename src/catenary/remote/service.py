"""Remote service: one thread that answers the requests of all clients of a share.

Theory of operation. The thread runs in passes. A pass receives at most one message of each client,
and continues the requests. Both end after SLICE. Then the thread sleeps for PAUSE, so that it
disturbs few cycles of a loop on its processor. Further messages stay in the sockets of their
senders, which then block. Requests beyond the rate limit receive BusyError with the time after
which to repeat them.

A request that waits for a device stays pending, and does not delay the others. Each has a deadline.
Clients that do not read, or send messages that are too long, lose their connection.
"""

from __future__ import annotations

import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import msgspec

from catenary.bus.thread_priority import leave_real_time
from catenary.errors import BusyError, ShareError
from catenary.remote.limits import RateLimit
from catenary.remote.listener import Connection, Listener
from catenary.remote.messages import VERSION, WRITES, Request
from catenary.remote.methods import Methods
from catenary.remote.task import Task, encode_error

SLICE = 200e-6  # [s] of work in one pass
PAUSE = 0.005  # [s] between two passes
IDLE = 0.5  # [s] between two passes without messages and requests
CLIENTS = 32
PENDING = 32  # requests of all clients
PENDING_EACH = 8  # requests of one client
END_TIMEOUT = 2.0  # [s]

OnWrite = Callable[[Task], None]


class Service:
    """Owner of the listening socket, the connections, the pending requests and the thread."""

    def __init__(self, listener: Listener, methods: Methods, on_write: OnWrite) -> None:
        self._listener = listener
        self._methods = methods
        self._on_write = on_write
        self._limit = RateLimit()
        self._clients: deque[Connection] = deque()  # in the order of their turns
        self._tasks: deque[Task] = deque()
        self._ended = threading.Event()
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._serve, name="catenary remote", daemon=True)

    def start(self, under: Path) -> None:
        """Publish the socket under a path, and start the thread."""
        self._listener.publish(under)
        self._thread.start()

    def close(self) -> None:
        """Remove the socket, answer the pending requests with ShareError, and end the thread."""
        self._ended.set()
        os.eventfd_write(self._wake, 1)
        if self._thread.is_alive():
            self._thread.join(END_TIMEOUT)
        if self._thread.is_alive():
            return  # the thread is starved; it closes the sockets when it runs again
        if self._thread.ident is None:
            self._release()
        os.close(self._wake)

    def _serve(self) -> None:
        leave_real_time()
        try:
            while not self._ended.is_set():
                if self._receive(0.0 if self._is_busy else IDLE) or self._is_busy:
                    self._continue()
                    self._ended.wait(PAUSE)
        finally:
            self._release()

    @property
    def _is_busy(self) -> bool:
        return bool(self._tasks) or any(client.has_mail for client in self._clients)

    def _release(self) -> None:
        for task in self._tasks:
            task.connection.send(*task.cancel(ShareError("the loop of the share has ended")))
        for client in self._clients:
            client.close()
        self._listener.close()

    def _receive(self, timeout: float) -> bool:
        """Receive messages for at most SLICE, and accept a client. Return False if there are none.

        Args:
            timeout: Time to wait for the first message [s].
        """
        self._clients = deque(client for client in self._clients if client.open)
        poll = select.poll()
        for number in (self._wake, self._listener.fileno(), *(c.fileno() for c in self._clients)):
            poll.register(number, select.POLLIN)
        ready = dict(poll.poll(timeout * 1000))
        for client in self._clients:
            if ready.get(client.fileno(), 0) & select.POLLHUP:  # the client has gone
                client.close()
        self._clients = deque(client for client in self._clients if client.open)
        if self._listener.fileno() in ready:
            self._accept()
        until = time.perf_counter() + SLICE
        for client in [client for client in self._clients if client.fileno() in ready]:
            self._clients.remove(client)  # its next turn comes after the others
            self._clients.append(client)
            message = client.receive()
            if message is not None:
                self._begin(client, message)
            if time.perf_counter() >= until:
                break
        return bool(ready)

    def _accept(self) -> None:
        client = self._listener.accept()
        if client is None:
            return
        if len(self._clients) < CLIENTS:
            self._clients.append(client)
            return
        client.send(encode_error(0, ShareError(f"the share already has {CLIENTS} clients")))
        client.close()

    def _begin(self, client: Connection, message: bytes) -> None:
        pause = self._limit.wait_for(time.monotonic())
        try:
            request = msgspec.msgpack.decode(message, type=Request)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            return client.send(encode_error(0, ValueError(f"invalid request: {error}")))
        refusal = self._refusal(client, request, pause)
        if refusal is not None:
            return client.send(encode_error(request.serial, refusal))
        task = Task(client, request)
        client.pending += 1
        answer = task.start(self._methods)
        if answer is None:
            self._tasks.append(task)
        else:
            self._answer(task, answer)

    def _refusal(self, client: Connection, request: Request, pause: float) -> ShareError | None:
        """Return the error for a request that is not begun; None if it is accepted."""
        if request.version != VERSION:
            return ShareError(
                f"the program uses version {VERSION} of the remote messages, not {request.version}",
                hint="use the same version of Catenary in both programs",
            )
        if pause > 0:
            return BusyError("the program of the share receives too many requests", retry=pause)
        if client.pending >= PENDING_EACH or len(self._tasks) >= PENDING:
            return BusyError("too many requests of the share are pending", retry=0.05)
        return None

    def _continue(self) -> None:
        """Send queued messages and continue the pending requests in turn, for at most SLICE."""
        for client in self._clients:
            if client.has_mail:
                client.flush(time.monotonic())
        until = time.perf_counter() + SLICE
        for _ in range(len(self._tasks)):
            task = self._tasks.popleft()
            answer = task.step(until)
            if answer is not None:
                self._answer(task, answer)
            elif task.connection.open:
                self._tasks.append(task)
            else:
                self._drop(task)
            if time.perf_counter() >= until:
                break

    def _drop(self, task: Task) -> None:
        """End a request of a closed connection. A transfer in progress continues to its end."""
        task.cancel(ShareError("the client has closed its connection"))

    def _answer(self, task: Task, answer: list[bytes]) -> None:
        task.connection.pending -= 1
        task.connection.send(*answer)
        if task.succeeded and task.request.method in WRITES:
            self._on_write(task)
