"""One browser: its WebSocket, its role, its queue and its jogs."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from functools import partial

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from catenary.dashboard.hub import Hub
from catenary.dashboard.messages import (
    OPERATOR_ONLY,
    Beat,
    ClientMessage,
    Ping,
    Poses,
    Press,
    Release,
    Request,
    Stop,
    Subscribe,
    Unsubscribe,
    decode_message,
    encode_message,
    op_of,
)
from catenary.dashboard.motion import Motion
from catenary.dashboard.outbox import Outbox
from catenary.dashboard.security import Role
from catenary.errors import CatenaryError
from catenary.remote.limits import RateLimit
from catenary.share import Reader

MESSAGES_PER_SECOND, MESSAGES_AT_ONCE = 400.0, 800.0
WORK_MAX = 64  # motion messages that wait for the worker
CLOSE_POLICY, CLOSE_BUSY = 1008, 1013
Work = Callable[[], None]
REFUSED = (CatenaryError, ValueError, RuntimeError, OverflowError, OSError)


class Client:
    """Connection to one browser.

    Args:
        hub: the hub.
        socket: accepted WebSocket.
        role: role of the session.
        refusal: reason why the server has no operators; None if it has.
    """

    def __init__(self, hub: Hub, socket: WebSocket, role: Role, refusal: str | None) -> None:
        self.role = role
        self.outbox = Outbox()
        self.wants_poses = False
        self._hub = hub
        self._socket = socket
        self._refusal = refusal
        self._motion = Motion()
        self._limit = RateLimit(MESSAGES_PER_SECOND, MESSAGES_AT_ONCE)
        self._work: asyncio.Queue[tuple[ClientMessage, Work]] = asyncio.Queue(WORK_MAX)

    async def run(self) -> None:
        """Serve the client until it disconnects. Then release its jogs."""
        if not self._hub.add(self):
            await self._socket.close(CLOSE_BUSY, "too many clients")
            return
        tasks = [asyncio.create_task(each()) for each in (self._send_all, self._execute_all)]
        try:
            await self._receive_all()
        finally:
            self._hub.remove(self)
            for task in tasks:
                task.cancel()
            await asyncio.shield(self._in_thread(self._motion.end_all))

    def send(self, text: str) -> None:
        """Queue a message."""
        self.outbox.put_text(text)

    def reason_no_jog(self) -> str | None:
        """Return why this client cannot jog; None if it can."""
        if self.role != "operator":
            return self._refusal or "this link is for viewers"
        return self._hub.source.reason_no_jog

    def follow_motion(self) -> None:
        """Report changes of jogs and refused requests, and release jogs that have ended."""
        for change in self._motion.changes():
            status = change.status
            self._report_jog(change.axis, change.press, status.name, status.text)
            if status.over:
                end = Release(change.axis, change.press)
                self._enqueue(end, partial(self._motion.end, change))
        for text in self._motion.refusals():
            self._refuse("request", RuntimeError(text))

    def forget_motion(self) -> None:
        """Drop all jogs and requests, because the loop has ended."""
        self._motion.forget()

    async def _receive_all(self) -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                received = await self._socket.receive()
                if received["type"] == "websocket.disconnect":
                    return
                if self.outbox.overflow or self._limit.wait_for(time.monotonic()) > 0:
                    await self._socket.close(CLOSE_POLICY, "too many messages")
                    return
                self._handle(received.get("text") or received.get("bytes") or "")

    def _handle(self, text: str | bytes) -> None:
        try:
            message = decode_message(text)
        except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
            self._refuse("", ValueError(f"the message is not valid: {error}"))
            return
        if isinstance(message, OPERATOR_ONLY) and self.role != "operator":
            reason = self.reason_no_jog()
            self._refuse(op_of(message), PermissionError(f"only operators can do this: {reason}"))
            return
        try:
            self._act(message)
        except REFUSED as error:
            self._refuse(op_of(message), error)

    def _act(self, message: ClientMessage) -> None:
        match message:
            case Ping(t=t):
                self.send(encode_message("pong", t=t))
            case Unsubscribe(id=id):
                if self._hub.subscriptions is not None:
                    self._hub.subscriptions.remove(self, id)
            case Subscribe():
                self._subscribe(message)
            case Stop():
                self._hub.stop()
                self.send(encode_message("stopped"))
            case Poses(on=on):
                self.wants_poses = on
            case Beat():
                self._enqueue(message, partial(self._motion.beat, message))
            case Release():
                self._enqueue(message, partial(self._motion.release, message))
            case Press():
                self._enqueue(message, partial(self._motion.press, self._reader(), message))
            case Request():
                self._request(message)

    def _request(self, message: Request) -> None:
        reader = self._reader()
        if message.run not in (None, reader.layout.run):
            raise RuntimeError("the loop has restarted; its axes may be others")
        self._enqueue(message, partial(self._motion.request, reader, message))

    def _subscribe(self, message: Subscribe) -> None:
        reader, subscriptions = self._reader(), self._hub.subscriptions
        assert subscriptions is not None
        subscriptions.add(self, message, self.outbox.put_frame, reader.number)

    def _reader(self) -> Reader:
        """Return the reader. Raises RuntimeError if there is no share."""
        reader = self._hub.source.reader
        if reader is None:
            raise RuntimeError(self._hub.source.reason)
        return reader

    def _enqueue(self, message: ClientMessage, work: Work) -> None:
        try:
            self._work.put_nowait((message, work))
        except asyncio.QueueFull:
            error = RuntimeError("the desk of the loop is locked; requests are waiting")
            self._refuse(op_of(message), error)

    async def _execute_all(self) -> None:
        while True:
            message, work = await self._work.get()
            try:
                await self._in_thread(work)
            except REFUSED as error:
                if isinstance(message, Press):
                    text = getattr(error, "message", str(error))
                    self._report_jog(message.axis, message.press, "REFUSED", text)
                else:
                    self._refuse(op_of(message), error)

    def _in_thread(self, work: Callable[[], object]) -> asyncio.Future[object]:
        return asyncio.get_running_loop().run_in_executor(self._hub.workers, work)

    async def _send_all(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the browser has left
            while True:
                data = await self.outbox.next()
                if isinstance(data, bytes):
                    await self._socket.send_bytes(data)
                else:
                    await self._socket.send_text(data)

    def _report_jog(self, axis: int, press: int, status: str, text: str) -> None:
        self.send(encode_message("jog", axis=axis, press=press, status=status, text=text))

    def _refuse(self, op: str, error: Exception) -> None:
        message, hint = getattr(error, "message", str(error)), getattr(error, "hint", "")
        kind = type(error).__name__
        self.send(encode_message("error", about=op, kind=kind, message=message, hint=hint))
