"""Client without a page: it sends what a browser never would."""

from __future__ import annotations

import json
import time
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

from tests.browser.processes import Dashboard
from tests.share.processes import DEADLINE


class RawClient:
    """Owner of a WebSocket with the cookie of a role."""

    def __init__(self, dashboard: Dashboard, role: str = "operator") -> None:
        import httpx
        from websockets.sync.client import connect

        link = urlsplit(dashboard.links[role])
        origin = f"{link.scheme}://{link.netloc}"
        token = link.fragment.removeprefix("token=")
        reply = httpx.post(f"{origin}/login", json={"token": token}, headers={"Origin": origin})
        reply.raise_for_status()
        cookies = "; ".join(f"{name}={value}" for name, value in reply.cookies.items())
        self._connecting = connect(
            f"ws://{link.netloc}/ws",
            origin=origin,  # type: ignore[arg-type]
            additional_headers={"Cookie": cookies},
            max_size=None,
            max_queue=None,  # receive all messages, also those that the test does not read
        )

    def send(self, **message: object) -> None:
        self.socket.send(json.dumps(message))

    def receive(self) -> dict[str, Any]:
        """Return the next JSON message."""
        while True:
            data = self.socket.recv(timeout=DEADLINE)
            if isinstance(data, str):
                return json.loads(data)  # type: ignore[no-any-return]

    def until(self, op: str, **values: object) -> dict[str, Any]:
        """Return the next message of a kind with these values."""
        end, others = time.monotonic() + DEADLINE, []
        while time.monotonic() < end:
            message = self.receive()
            if message["op"] == op and values.items() <= message.items():
                return message
            if message["op"] in (op, "error"):
                others.append(message)
        raise AssertionError(f"no message {op!r} with {values}, but {others[-5:]}")

    def press(self, velocity: float) -> tuple[int, str]:
        """Begin a jog of axis 0. Return the number of its press and the token that it used.

        On a busy machine, a token can be too old when it arrives: then press again.
        """
        for number in range(1, 20):
            token: str = self.until("token")["token"]
            self.send(
                op="press", axis=0, velocity=velocity, distance=None, token=token, press=number
            )
            status = self.until("jog", press=number)["status"]
            if status not in ("REFUSED_STALE", "REFUSED_MOVING"):
                assert status == "MOVING"
                return number, token
        raise AssertionError("each press was refused")

    def __enter__(self) -> Self:
        self.socket = self._connecting.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._connecting.__exit__(kind, error, trace)
