"""Checks and headers of every request, before any route."""

from __future__ import annotations

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from catenary.dashboard.security import HEADERS, Access


class Guard:
    """ASGI application that checks Host and Origin, and adds the security headers.

    Args:
        app: the application that receives the accepted requests.
        access: tokens and allowed hosts.
    """

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request to the application, or refuse it with status 403."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        problem = self.problem(scope)
        if problem and scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008, "reason": problem})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        app = PlainTextResponse(problem, 403) if problem else self.app
        await app(scope, receive, send_with_headers)

    def problem(self, scope: Scope) -> str:
        """Return the reason for a refusal; "" if the request is accepted."""
        headers = Headers(scope=scope)
        if not self._access.is_own_host(headers.get("host", "")):
            return f"this server does not have the name {headers.get('host', '')!r}"
        changes = scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")
        if changes and not self._access.is_own_origin(headers):
            return "the request comes from another site"
        return ""
