"""Client without a page: it sends what a browser never would."""

from __future__ import annotations

import json
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
        self.socket = connect(
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
        while True:
            message = self.receive()
            if message["op"] == op and values.items() <= message.items():
                return message

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.socket.close()
