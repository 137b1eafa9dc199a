"""Start of the server: links, QR code, TLS and errors."""

from __future__ import annotations

import shutil
import socket
import subprocess
from pathlib import Path

import httpx
import pytest

from catenary.dashboard.security import Access
from catenary.dashboard.server import (
    Options,
    announcement,
    link,
    make_access,
    open_socket,
    qr_code,
    require_packages,
    shown_host,
)
from catenary.errors import ConfigurationError
from tests.dashboard.serving import DEADLINE, serving

KEY = bytes(32)


def access(**options: object) -> Access:
    return Access(KEY, **{"host": "127.0.0.1", "port": 8710, **options})  # type: ignore[arg-type]


def test_the_links_contain_the_tokens_in_their_fragments() -> None:
    door = access()
    lines = announcement(door).splitlines()
    assert lines[0] == f"operator: http://127.0.0.1:8710/#token={door.token('operator')}"
    assert lines[1] == f"viewer: http://127.0.0.1:8710/#token={door.token('viewer')}"
    assert "not an emergency stop" in lines[2]
    assert len(lines) == 3


def test_beyond_this_machine_there_is_a_qr_code_and_without_tls_no_operator() -> None:
    text = announcement(access(host="192.0.2.7"))
    assert "operator: " not in text
    assert "no operators: operators beyond this machine need TLS" in text
    assert qr_code(link(access(host="192.0.2.7"), "viewer")) in text
    assert "█" in text or "▀" in text


def test_with_tls_the_link_of_the_operator_is_drawn() -> None:
    door = access(host="192.0.2.7", tls=True)
    text = announcement(door)
    assert f"operator: https://192.0.2.7:8710/#token={door.token('operator')}" in text
    assert qr_code(link(door, "operator")) in text
    assert qr_code(link(door, "operator")) not in announcement(door, draw=False)


def test_hosts_in_links() -> None:
    assert shown_host("::1") == "[::1]"
    assert shown_host("robot") == "robot"
    assert shown_host("0.0.0.0") not in ("0.0.0.0", "")


@pytest.mark.parametrize("given", [{"cert": Path("c")}, {"key": Path("k")}])
def test_tls_needs_both_files(given: dict[str, Path]) -> None:
    with pytest.raises(ConfigurationError, match="--cert and --key"):
        make_access(Options(**given))


def test_an_unusable_certificate_is_refused(tmp_path: Path) -> None:
    (tmp_path / "pem").write_text("nothing")
    with pytest.raises(ConfigurationError, match="TLS cannot use"):
        make_access(Options(cert=tmp_path / "pem", key=tmp_path / "pem"))


def test_a_used_port_is_refused_with_a_hint() -> None:
    with open_socket("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(ConfigurationError, match=f"port {port}") as refused:
            open_socket("127.0.0.1", port)
    assert "--port" in str(refused.value.hint)


def test_the_key_is_in_the_folder_of_this_user(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In the folder of the group, the key of one user would lock out the others."""
    monkeypatch.setattr("catenary.share.folder.GROUP_FOLDER", tmp_path)
    monkeypatch.setattr("catenary.share.folder._is_group_folder", lambda: True)
    make_access(Options())
    assert not list(tmp_path.iterdir())


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.dashboard.server.NEEDED", ("no_such_package",))
    with pytest.raises(ConfigurationError, match="no_such_package") as missing:
        require_packages()
    assert "catenary[dashboard]" in missing.value.hint


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificate")
def test_a_server_with_tls_gives_secure_cookies(name: str, tmp_path: Path) -> None:
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    files = ["-keyout", str(key), "-out", str(cert)]
    options = ["-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=localhost", *files]
    subprocess.run(["openssl", "req", "-x509", *options], check=True, capture_output=True)
    with serving(name, cert=cert, key=key) as page:
        url = page.url.replace("http:", "https:")
        body = {"token": page.access.token("operator")}
        answer = httpx.post(
            f"{url}/login", json=body, headers={"Origin": url}, verify=False, timeout=DEADLINE
        )
        assert answer.status_code == 204
        assert "Secure" in answer.headers["set-cookie"]
        foreign = httpx.post(
            f"{url}/login", json=body, headers={"Origin": page.url}, verify=False, timeout=DEADLINE
        )
        assert foreign.status_code == 403


def test_messages_are_sent_without_delay() -> None:
    """Asyncio sets TCP_NODELAY only if the socket names its protocol."""
    with open_socket("127.0.0.1", 0) as listening:
        assert listening.proto == socket.IPPROTO_TCP
