"""A server in this process, and clients of it."""

from __future__ import annotations

import contextlib
import json
import struct
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
import pytest

from tests.share.processes import Program

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from websockets.sync.client import ClientConnection, connect

from catenary.dashboard.hub import Hub
from catenary.dashboard.panels import make_companions, make_scene
from catenary.dashboard.requests import Requests
from catenary.dashboard.security import Access, Role
from catenary.dashboard.server import Options, make_access, make_server, open_socket
from catenary.dashboard.source import Source

PROGRAM = Path(__file__).with_name("loop_program.py")
DEADLINE = 30.0  # [s]


@contextlib.contextmanager
def running_loop(name: str, axes: int = 2, *options: str) -> Iterator[Program]:
    """Run a loop in real time in a child process."""
    program = Program.of([sys.executable, str(PROGRAM), name, str(axes), *options])
    try:
        assert program.line() == "running"
        yield program
    finally:
        program.kill()
        program.close()


@dataclass
class Page:
    """A running server."""

    access: Access
    hub: Hub

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.access.port}"

    def client(self, role: Role | None = "operator") -> httpx.Client:
        """Return an HTTP client, logged in unless `role` is None."""
        name, _, value = ("" if role is None else self.cookie(role)).partition("=")
        cookies = {name: value} if name else {}
        headers = {"Origin": self.url}
        return httpx.Client(base_url=self.url, headers=headers, cookies=cookies, timeout=DEADLINE)

    def cookie(self, role: Role) -> str:
        """Log in, and return the cookie as NAME=VALUE."""
        return log_in(self.url, self.access.token(role))

    def socket(self, role: Role = "operator") -> Socket:
        return Socket.of(self.url, self.cookie(role))


def log_in(url: str, token: str) -> str:
    answer = httpx.post(f"{url}/login", json={"token": token}, headers={"Origin": url})
    assert answer.status_code == 204, answer.text
    return answer.headers["set-cookie"].partition(";")[0]


class Socket:
    """WebSocket of a browser."""

    def __init__(self, manager: AbstractContextManager[ClientConnection]) -> None:
        self._manager = manager
        self.connection: ClientConnection

    @classmethod
    def of(cls, url: str, cookie: str) -> Socket:
        return cls(
            connect(
                url.replace("http", "ws") + "/ws",
                origin=url,  # type: ignore[arg-type]
                additional_headers={"Cookie": cookie},
                max_size=None,
                compression=None,
            )
        )

    @classmethod
    def open(cls, url: str, token: str) -> Socket:
        """Log in, and connect."""
        return cls.of(url, log_in(url, token))

    def any(self) -> dict[str, object]:
        """Return the next message; skip frames."""
        while True:
            received = self.connection.recv(DEADLINE)
            if isinstance(received, str):
                message: dict[str, object] = json.loads(received)
                return message

    def jog_until(self, press: int, status: str) -> dict[str, object]:
        """Return the message with which a jog reaches a status."""
        while (message := self.next("jog")) != {**message, "press": press, "status": status}:
            pass
        return message

    def send(self, op: str, **content: object) -> None:
        self.connection.send(json.dumps({"op": op, **content}))

    def next(self, op: str) -> dict[str, object]:
        """Return the next message of a kind; skip others."""
        while True:
            received = self.connection.recv(DEADLINE)
            if isinstance(received, str) and (message := json.loads(received))["op"] == op:
                return message

    def frame(self) -> DecodedFrame:
        """Return the next binary frame; skip messages."""
        while True:
            received = self.connection.recv(DEADLINE)
            if isinstance(received, bytes):
                return decode_frame(received)

    def __enter__(self) -> Socket:
        self.connection = self._manager.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._manager.__exit__(None, None, None)


@dataclass
class DecodedFrame:
    """A binary frame; `values` has shape (signals, rows) or (signals, rows, 2)."""

    kind: int
    id: int
    rows: int
    lost: int
    first: int
    period: float
    time: np.ndarray
    values: np.ndarray


def decode_frame(data: bytes) -> DecodedFrame:
    kind, version, id, rows, signals, lost, first, period = struct.unpack("<BBHIIIdd", data[:32])
    assert version == 1
    time = np.frombuffer(data, "<f8", rows, 32)
    rest = 32 + 8 * rows
    if kind == 1:
        values = np.frombuffer(data, "<f8", signals * rows, rest).reshape(signals, rows)
    else:
        values = np.frombuffer(data, "<f4", 2 * signals * rows, rest).reshape(signals, rows, 2)
    return DecodedFrame(kind, id, rows, lost, int(first), period, time, values)


@contextlib.contextmanager
def serving(share: str, *, port: int = 0, **options: object) -> Iterator[Page]:
    """Run a server in a thread."""
    listening = open_socket("127.0.0.1", port)
    given = Options(port=listening.getsockname()[1], **options)  # type: ignore[arg-type]
    access = make_access(given)
    hub = Hub(
        Source(share),
        Requests(share),
        scene=make_scene(given.panels),
        companions=make_companions(given.panels),
    )
    server = make_server(access, hub, given)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        yield Page(access, hub)
    finally:
        server.should_exit = True
        thread.join(DEADLINE)
        listening.close()
