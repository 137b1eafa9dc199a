"""Start of the server: address, TLS, links and their QR code."""

from __future__ import annotations

import io
import os
import socket
import ssl
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.dashboard.options import Panels
from catenary.dashboard.security import Access, Role, is_loopback, load_key
from catenary.errors import ConfigurationError
from catenary.share.folder import prepare, user_folder

if TYPE_CHECKING:
    import uvicorn

    from catenary.dashboard.hub import Hub

PORT = 8710
CONNECTIONS_MAX = 128
MESSAGE_MAX = 64 << 10  # bytes of a message of a browser
PING_SECONDS = 10.0
REDIRECTION = (
    '<!doctype html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
    '<meta http-equiv="refresh" content="0; url={link}"><title>Catenary</title>'
)
NEEDED = ("starlette", "uvicorn", "websockets", "segno")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of the server.

    `cert`, `key`: files of TLS, in PEM format. `uid`: owner of the share; None: this user or root.
    `panels`: files for the 3D view and the recordings.
    """

    host: str = "127.0.0.1"
    port: int = PORT
    cert: Path | None = None
    key: Path | None = None
    viewer_only: bool = False
    new_links: bool = False
    uid: int | None = None
    panels: Panels = field(default_factory=Panels)


def require_packages() -> None:
    """Raise ConfigurationError if a package of the extra `dashboard` is missing."""
    from importlib.util import find_spec

    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise ConfigurationError(
            f"the page needs {', '.join(missing)}", hint="pip install 'catenary[dashboard]'"
        )


def make_access(options: Options) -> Access:
    """Return the tokens and roles of a server.

    Raises:
        ConfigurationError: only one of `cert` and `key` is given, or TLS cannot use them.
        PermissionError: the stored key is not private.
    """
    if (options.cert is None) != (options.key is None):
        raise ConfigurationError("TLS needs --cert and --key")
    if options.cert is not None and options.key is not None:
        check_certificate(options.cert, options.key)
    return Access(
        load_key(key_folder(), renew=options.new_links),
        host=options.host,
        port=options.port,
        tls=options.cert is not None,
        viewer_only=options.viewer_only,
    )


def key_folder() -> Path:
    """Return the folder of this user's key. In /run/catenary, several users would share one."""
    folder = user_folder(os.geteuid())
    prepare(folder, 0o600)
    return folder


def check_certificate(cert: Path, key: Path) -> None:
    """Raise ConfigurationError if TLS cannot use a certificate and its key."""
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(cert, key)
    except (OSError, ssl.SSLError) as error:
        raise ConfigurationError(
            f"TLS cannot use {cert} with {key}: {error}",
            hint="pass the certificate and its private key in PEM format",
        ) from error


def open_socket(host: str, port: int) -> socket.socket:
    """Return a listening socket. Port 0 selects a free port.

    Raises:
        ConfigurationError: the address is not available.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, kind, protocol, _, address = found[0]
        listening = socket.socket(family, kind, protocol)  # asyncio disables Nagle only for TCP
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(64)
    except OSError as error:
        raise ConfigurationError(
            f"cannot listen on {host}, port {port}: {error.strerror or error}",
            hint="another server may use the port: pass --port, or --port 0 for a free one",
        ) from error
    return listening


def link(access: Access, role: Role) -> str:
    """Return the link of a role. Its fragment contains the token."""
    scheme = "https" if access.tls else "http"
    return f"{scheme}://{shown_host(access.host)}:{access.port}/#token={access.token(role)}"


def link_file(access: Access, folder: Path) -> Path:
    """Write a private page that opens the first link, and return its path.

    All users can read the arguments of a process, so a browser receives this path and no token.

    Args:
        access: tokens and roles.
        folder: folder of the page.
    """
    path = folder / f"dashboard-{access.port}.html"
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "w") as file:
        file.write(REDIRECTION.format(link=link(access, access.roles[0])))
    return path


def shown_host(host: str) -> str:
    """Return a host as in a link; for "all addresses", the address of this machine."""
    if host in ("0.0.0.0", "::"):
        host = own_address()
    return f"[{host}]" if ":" in host else host


def own_address() -> str:
    """Return the address with which this machine reaches others; its name if there is none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # selects a route; UDP sends nothing here
            address: str = probe.getsockname()[0]
        except OSError:
            return socket.gethostname()
    return address


def qr_code(text: str) -> str:
    """Return the QR code of a text for a terminal."""
    import segno

    drawing = io.StringIO()
    segno.make(text, micro=False, error="l").terminal(drawing, compact=True, border=1)
    return drawing.getvalue()


def announcement(access: Access, *, draw: bool = True) -> str:
    """Return the text with the links.

    Args:
        access: tokens and roles.
        draw: True to add the QR code of the first link, unless only this machine can open it.
    """
    lines = [f"{role}: {link(access, role)}" for role in access.roles]
    if access.refusal is not None:
        lines.append(f"no operators: {access.refusal}")
    if draw and not is_loopback(access.host):
        lines.append(qr_code(link(access, access.roles[0])))
    lines.append("The page is not an emergency stop (ISO 13850). Press Ctrl-C to end the server.")
    return "\n".join(lines)


def make_server(access: Access, hub: Hub, options: Options) -> uvicorn.Server:
    """Return a server that is not started.

    Args:
        access: tokens and roles.
        hub: connection to the share.
        options: options of the server.
    """
    import uvicorn

    from catenary.dashboard.app import make_app
    from catenary.dashboard.panels import panel_routes

    settings = uvicorn.Config(
        make_app(access, hub, partial(panel_routes, options.panels)),
        log_level="warning",
        ssl_certfile=options.cert,
        ssl_keyfile=options.key,
        ws="websockets-sansio",
        ws_max_size=MESSAGE_MAX,
        ws_per_message_deflate=False,
        ws_ping_interval=PING_SECONDS,
        ws_ping_timeout=PING_SECONDS,
        limit_concurrency=CONNECTIONS_MAX,
        timeout_graceful_shutdown=2,
        server_header=False,
    )
    return uvicorn.Server(settings)


def run_server(
    share: str,
    options: Options,
    announce: Callable[[Access], None],
    problem: Callable[[], str] = str,
) -> None:
    """Serve the page of a share until a signal ends the server.

    Args:
        share: name of the share. It need not exist yet.
        options: options of the server.
        announce: called when the server listens.
        problem: returns the error of the program of the loop, or "".

    Raises:
        ConfigurationError: an option is not valid, or a package is missing.
    """
    require_packages()
    from catenary.dashboard.hub import Hub
    from catenary.dashboard.panels import make_companions, make_scene
    from catenary.dashboard.requests import Requests
    from catenary.dashboard.source import Source

    with open_socket(options.host, options.port) as listening:
        access = make_access(replace(options, port=listening.getsockname()[1]))
        scene = make_scene(options.panels)
        companions = make_companions(options.panels, options.uid)
        source, requests = Source(share, uid=options.uid), Requests(share, options.uid)
        hub = Hub(source, requests, problem, scene, companions)
        server = make_server(access, hub, options)
        announce(access)
        server.run(sockets=[listening])
