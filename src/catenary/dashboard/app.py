"""HTTP routes of the page and its WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from catenary.dashboard.client import CLOSE_POLICY, Client
from catenary.dashboard.doctor import run_doctor
from catenary.dashboard.guard import Guard
from catenary.dashboard.hub import Hub
from catenary.dashboard.report import make_report
from catenary.dashboard.requests import (
    CALLS_MAX,
    FAILURES,
    VIEWER_CALLS_MAX,
    error_body,
    is_allowed,
)
from catenary.dashboard.security import SESSION_SECONDS, Access, Role
from catenary.dashboard.static_files import StaticFile, read_static_files
from catenary.errors import BusyError, CatenaryError
from catenary.remote.limits import RateLimit

BODY_MAX = 64 << 10  # bytes
INDEX = "index.html"
T = TypeVar("T")
Handler = Callable[["Page", Request, Role], Awaitable[Response]]


class Login(msgspec.Struct):
    """Body of POST /login."""

    token: str


class Call(msgspec.Struct):
    """Body of POST /api/call."""

    method: str
    params: dict[str, object] = {}


@dataclass
class Page:
    """Parts that the routes need."""

    access: Access
    hub: Hub
    files: dict[str, StaticFile]
    logins: RateLimit
    doctor: asyncio.Lock


def no_routes(_: Page) -> list[BaseRoute]:
    """Return no routes."""
    return []


def make_app(
    access: Access, hub: Hub, more: Callable[[Page], list[BaseRoute]] = no_routes
) -> Guard:
    """Return the ASGI application.

    Args:
        access: tokens and roles.
        hub: connection to the share; the application runs it.
        more: returns further routes.
    """
    page = Page(access, hub, read_static_files(), RateLimit(2.0, 20.0), asyncio.Lock())

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(hub.run())
        task.add_done_callback(raise_failure)
        yield
        task.cancel()

    app = Starlette(routes=[*more(page), *routes_of(page)], lifespan=lifespan)
    app.router.redirect_slashes = False
    app.state.page = page
    return Guard(app, access)


def raise_failure(task: asyncio.Task[None]) -> None:
    """Report an unexpected end of the hub to the event loop, which logs it."""
    if not task.cancelled() and (error := task.exception()) is not None:
        raise error


def routes_of(page: Page) -> list[BaseRoute]:
    """Return the routes of the page."""

    def route(path: str, handler: Handler, *methods: str) -> Route:
        return Route(path, protected(page, handler), methods=list(methods or ("GET",)))

    async def serve_socket(socket: WebSocket) -> None:
        await serve(page, socket)

    async def serve_file(request: Request) -> Response:
        return static_response(page, request)

    async def serve_login(request: Request) -> Response:
        return await log_in(page, request)

    return [
        Route("/login", serve_login, methods=["POST"]),
        route("/api/session", session),
        route("/api/call", call, "POST"),
        route("/api/doctor", doctor, "POST"),
        route("/report.html", report),
        WebSocketRoute("/ws", serve_socket),
        Route("/", serve_file),
        Route("/{name}", serve_file),
    ]


def protected(page: Page, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
    """Return a handler that refuses requests without a valid cookie."""

    async def checked(request: Request) -> Response:
        role = page.access.role_of(request.cookies.get(page.access.cookie_name))
        if role is None:
            return refusal(401, "no valid session", hint="open the link that the terminal shows")
        return await handler(page, request, role)

    return checked


def static_response(page: Page, request: Request) -> Response:
    """Return a file of the page, or 304 if the browser already has it."""
    file = page.files.get(request.path_params.get("name", INDEX))
    if file is None:
        return refusal(404, "there is no such page")
    headers = {"ETag": file.tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    if request.headers.get("if-none-match") == file.tag:
        return Response(status_code=304, headers=headers)
    content = file.content
    if file.compressed is not None and "gzip" in request.headers.get("accept-encoding", ""):
        content, headers["Content-Encoding"] = file.compressed, "gzip"
    return Response(content, headers=headers, media_type=file.type)


async def log_in(page: Page, request: Request) -> Response:
    """Exchange the token of a link for a cookie."""
    body = await read_body(request, Login)
    if isinstance(body, Response):
        return body
    cookie = page.access.login(body.token)
    if cookie is None and page.logins.wait_for(time.monotonic()) > 0:
        return refusal(429, "too many wrong tokens", hint="wait a few seconds")
    if cookie is None:
        return refusal(403, "the token is not valid", hint="open the link that the terminal shows")
    return with_cookie(Response(status_code=204), page.access, cookie)


def with_cookie(response: Response, access: Access, cookie: str) -> Response:
    """Return the response, which now sets a cookie.

    Args:
        response: the response.
        access: tokens and roles.
        cookie: value of the cookie.
    """
    response.set_cookie(
        access.cookie_name,
        cookie,
        max_age=SESSION_SECONDS,
        httponly=True,
        samesite="strict",
        secure=access.tls,
    )
    return response


async def session(page: Page, request: Request, role: Role) -> Response:
    """Return the role of the session, and renew its cookie, so that an open page stays valid."""
    source = page.hub.source
    reason = source.reason_no_jog
    if role != "operator":
        reason = page.access.refusal or "this link is for viewers"
    facts = {
        "role": role,
        "share": source.name,
        "reason_no_jog": reason,
        "version": version("catenary"),
    }
    return with_cookie(json_response(facts), page.access, page.access.cookie(role))


async def call(page: Page, request: Request, role: Role) -> Response:
    """Return the result of a remote method."""
    body = await read_body(request, Call)
    if isinstance(body, Response):
        return body
    if not is_allowed(body.method, role):
        return refusal(403, f"the role {role} cannot call {body.method!r}")
    try:
        limit = CALLS_MAX if role == "operator" else VIEWER_CALLS_MAX
        result = await page.hub.requests.call(body.method, body.params, limit=limit)
        return json_response({"result": result})
    except BusyError as error:
        return json_response({"error": error_body(error), "retry": error.retry}, 429)
    except FAILURES as error:
        return json_response({"error": error_body(error)}, 400)


async def doctor(page: Page, request: Request, role: Role) -> Response:
    """Examine this machine, and return the result as JSON.

    The examination measures latency with a real-time thread, which can delay a loop.
    """
    if role != "operator":
        return refusal(403, f"the role {role} cannot examine the machine")
    if page.doctor.locked():
        return refusal(429, "the examination is already running", hint="wait for its result")
    async with page.doctor:
        try:
            return json_response({"result": await run_doctor()})
        except CatenaryError as error:
            return json_response({"error": error_body(error)}, 500)


async def report(page: Page, request: Request, role: Role) -> Response:
    """Return the report for a vendor, as a file."""
    text = await make_report(page.hub)
    headers = {"Content-Disposition": 'attachment; filename="catenary-report.html"'}
    return Response(text, headers=headers, media_type="text/html")


async def serve(page: Page, socket: WebSocket) -> None:
    """Serve the WebSocket of a browser."""
    access = page.access
    role = access.role_of(socket.cookies.get(access.cookie_name))
    await socket.accept()
    if role is None:
        await socket.close(CLOSE_POLICY, "no valid session")
        return
    await Client(page.hub, socket, role, access.refusal).run()


async def read_body(request: Request, kind: type[T]) -> T | Response:
    """Return the decoded body of a request, or the response to an invalid one."""
    content = b""
    async for part in request.stream():
        content += part
        if len(content) > BODY_MAX:
            return refusal(413, f"the request exceeds {BODY_MAX} bytes")
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        return refusal(400, f"the request is not valid: {error}")


def json_response(content: object, status: int = 200) -> Response:
    """Return a value as JSON. Bytes become base64; NaN becomes null."""
    headers = {"Cache-Control": "no-store"}
    body = msgspec.json.encode(content)
    return Response(body, status, headers=headers, media_type="application/json")


def refusal(status: int, message: str, *, hint: str = "") -> Response:
    """Return an error as JSON.

    Args:
        status: HTTP status.
        message: the error.
        hint: what to do.
    """
    error = {"kind": "Refused", "message": message, "hint": hint}
    return json_response({"error": error}, status)
