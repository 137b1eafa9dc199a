"""A server in this process, and clients of it."""

from __future__ import annotations

import contextlib
import json
import struct
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
import pytest

from tests.share.processes import Program

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

import uvicorn
from websockets.sync.client import ClientConnection, connect

from catenary.dashboard.app import make_app
from catenary.dashboard.hub import Hub
from catenary.dashboard.requests import Requests
from catenary.dashboard.security import Access, Role
from catenary.dashboard.server import Options, make_access, open_socket
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
        client = httpx.Client(base_url=self.url, headers={"Origin": self.url}, timeout=DEADLINE)
        if role is not None:
            answer = client.post("/login", json={"token": self.access.token(role)})
            assert answer.status_code == 204, answer.text
        return client

    def socket(self, role: Role = "operator") -> Socket:
        with self.client(role) as client:
            cookie = client.cookies[self.access.cookie_name]
        return Socket.of(self.url, f"{self.access.cookie_name}={cookie}")


class Socket:
    """WebSocket of a browser."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

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
        answer = httpx.post(f"{url}/login", json={"token": token}, headers={"Origin": url})
        assert answer.status_code == 204
        return cls.of(url, answer.headers["set-cookie"].partition(";")[0])

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
        return self

    def __exit__(self, *_: object) -> None:
        self.connection.close()


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
def serving(share: str, *, port: int = 0, viewer_only: bool = False) -> Iterator[Page]:
    """Run a server in a thread."""
    listening = open_socket("127.0.0.1", port)
    access = make_access(Options(port=listening.getsockname()[1], viewer_only=viewer_only))
    hub = Hub(Source(share), Requests(share))
    settings = uvicorn.Config(
        make_app(access, hub), log_level="warning", ws="websockets-sansio", ws_max_size=64 << 10,
        ws_per_message_deflate=False, timeout_graceful_shutdown=1,
    )  # fmt: skip
    server = uvicorn.Server(settings)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    try:
        yield Page(access, hub)
    finally:
        server.should_exit = True
        thread.join(DEADLINE)
        listening.close()
