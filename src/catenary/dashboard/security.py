"""Access to the page: links with tokens, cookies, roles, and the checks of each request.

Theory of operation. A secret key is stored in the folder of this user's shares, with mode 0600. The
tokens of the two roles and the signatures of cookies are derived from it. Links and cookies
therefore stay valid when the server restarts, until the machine restarts or `renew` replaces the
key. The token is in the fragment of the link, which browsers do not send. The page exchanges it for
a cookie that scripts cannot read.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
import secrets
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

Role = Literal["viewer", "operator"]

KEY_BYTES = 32
SESSION_SECONDS = 12 * 3600
CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'"
)
HEADERS = {
    "Content-Security-Policy": CSP,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Access:
    """Tokens, cookies and allowed hosts of one server.

    Args:
        key: secret key.
        port: TCP port, which separates the cookies of several servers.
        host: address on which the server listens.
        tls: True if the server uses TLS.
        viewer_only: True to offer no operator role.
        clock: wall clock, for the expiry of cookies [s].
    """

    def __init__(
        self,
        key: bytes,
        *,
        host: str,
        port: int,
        tls: bool = False,
        viewer_only: bool = False,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.host, self.port, self.tls = host, port, tls
        self.cookie_name = f"catenary-{port}"
        self._key = key
        self._clock = clock
        self._viewer_only = viewer_only

    @property
    def refusal(self) -> str | None:
        """Reason why this server has no operators; None if it has."""
        if self._viewer_only:
            return "the server was started with --viewer-only"
        if not self.tls and not is_loopback(self.host):
            return "operators beyond this machine need TLS: pass --cert and --key"
        return None

    @property
    def roles(self) -> tuple[Role, ...]:
        """Roles that this server offers."""
        return ("viewer",) if self.refusal else ("operator", "viewer")

    def token(self, role: Role) -> str:
        """Return the token in the link of a role."""
        return self._sign(f"token {role}")[:43]

    def login(self, token: str) -> str | None:
        """Return the value of the cookie for a token; None if the token is wrong."""
        for role in self.roles:
            if hmac.compare_digest(token.encode(), self.token(role).encode()):
                return self.cookie(role)
        return None

    def cookie(self, role: Role) -> str:
        """Return the value of a new cookie for a role."""
        expiry = round(self._clock() + SESSION_SECONDS)
        return f"{role}.{expiry}.{self._sign(f'cookie {role} {expiry}')}"

    def role_of(self, cookie: str | None) -> Role | None:
        """Return the role of a cookie; None if it is missing, forged or expired."""
        role, _, rest = (cookie or "").partition(".")
        expiry, _, signature = rest.partition(".")
        expected = self._sign(f"cookie {role} {expiry}")
        if not hmac.compare_digest(signature.encode(), expected.encode()):
            return None
        if int(expiry) < self._clock():
            return None
        return next((each for each in self.roles if each == role), None)

    def is_own_host(self, host: str) -> bool:
        """Return True if a Host header names this server.

        A host is an address, `localhost`, or a name of this machine. A page of another site
        therefore cannot reach the server under its own name (DNS rebinding). The port is free, for
        tunnels; `is_own_origin` compares it.
        """
        name = name_of_host(host)
        if is_loopback(self.host):
            return name == "localhost" or (is_address(name) and is_loopback(name))
        machine = socket.gethostname().lower()
        names = ("localhost", machine, f"{machine}.local", self.host.lower())
        return is_address(name) or name in names

    def is_own_origin(self, headers: Mapping[str, str]) -> bool:
        """Return True if the Origin header is present and names the same site as Host."""
        scheme = "https" if self.tls else "http"
        return headers.get("origin", "") == f"{scheme}://{headers.get('host', '')}"

    def _sign(self, text: str) -> str:
        return hmac.new(self._key, f"{self.port} {text}".encode(), hashlib.sha256).hexdigest()


def load_key(folder: Path, *, renew: bool = False) -> bytes:
    """Return the key of this user; create it if it does not exist.

    Args:
        folder: folder of the key, private to this user.
        renew: True to replace the key, so that all links and cookies become invalid.

    Raises:
        PermissionError: the file belongs to another user or others can read it.
    """
    path = folder / "dashboard-key"
    if renew:
        path.unlink(missing_ok=True)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except FileNotFoundError:
        return _make_key(path)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(file.fileno())
        if status.st_uid != os.geteuid() or status.st_mode & 0o077:
            raise PermissionError(f"{path} is not private to this user; remove it")
        key = file.read(KEY_BYTES + 1)
    return key if len(key) == KEY_BYTES else _make_key(path)


def _make_key(path: Path) -> bytes:
    key = secrets.token_bytes(KEY_BYTES)
    draft = path.with_name(f".draft-{os.getpid()}-dashboard-key")
    draft.unlink(missing_ok=True)
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(key)
    draft.rename(path)
    return key


def name_of_host(host: str) -> str:
    """Return the name in a Host header, in lower case, without port and brackets."""
    name, colon, port = host.rpartition(":")
    return (name if colon and port.isdecimal() else host).strip("[]").lower()


def is_address(name: str) -> bool:
    """Return True if a name is an IP address."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Return True if only programs on this machine can reach a host."""
    if host == "localhost":
        return True
    return is_address(host) and ipaddress.ip_address(host).is_loopback
