"""Web pages of a virtual device: HTTP/1.1 (RFC 9112), one request for each connection."""

from __future__ import annotations

from collections.abc import Mapping

REQUEST_MAX = 8192  # [bytes]
END = b"\r\n\r\n"


def answer(request: bytes, pages: Mapping[str, str]) -> bytes | None:
    """Return the answer to a request; None if the request is not complete.

    Args:
        request: Bytes received so far.
        pages: Web pages by path.
    """
    if END not in request:
        return _answer("431 Too Large", "the request is too long\n") if _too_long(request) else None
    words = request.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        return _answer("400 Bad Request", "not an HTTP request\n")
    method, path = words[0], words[1].split("?", 1)[0]
    if method not in ("GET", "HEAD"):
        return _answer("405 Method Not Allowed", "only GET and HEAD\n")
    page = pages.get(path)
    status = "404 Not Found" if page is None else "200 OK"
    text = f"no page {path}\n" if page is None else page
    return _answer(status, text, head=method == "HEAD")


def _too_long(request: bytes) -> bool:
    return len(request) > REQUEST_MAX


def _answer(status: str, text: str, *, head: bool = False) -> bytes:
    body = text.encode()
    kind = "text/html" if text.lstrip().startswith("<") else "text/plain"
    lines = (
        f"HTTP/1.1 {status}",
        f"Content-Type: {kind}; charset=utf-8",
        f"Content-Length: {len(body)}",
        "Connection: close",
    )
    return "\r\n".join(lines).encode() + END + (b"" if head else body)
