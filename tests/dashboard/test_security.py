"""Tokens, cookies, roles, hosts and origins."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.dashboard.security import Access, is_loopback, load_key, name_of_host

KEY = bytes(32)


def access(**options: object) -> Access:
    return Access(KEY, **{"host": "127.0.0.1", "port": 8710, **options})  # type: ignore[arg-type]


def test_a_token_gives_a_cookie_of_its_role() -> None:
    door = access()
    for role in ("operator", "viewer"):
        assert door.role_of(door.login(door.token(role))) == role


@pytest.mark.parametrize("token", ["", "x", "ä", access(port=1).token("viewer")])
def test_another_token_gives_no_cookie(token: str) -> None:
    assert access().login(token) is None


def test_cookies_stay_valid_after_a_restart_but_not_on_another_port_or_with_a_new_key() -> None:
    cookie = access().login(access().token("viewer"))
    assert access().role_of(cookie) == "viewer"
    assert access(port=8711).role_of(cookie) is None
    assert Access(b"1" * 32, host="127.0.0.1", port=8710).role_of(cookie) is None


@pytest.mark.parametrize("forged", [None, "", "operator", "operator.9999999999.", "a.b.c", "…"])
def test_forged_cookies_have_no_role(forged: str | None) -> None:
    assert access().role_of(forged) is None


def test_a_viewer_cannot_change_the_role_or_the_expiry_in_its_cookie() -> None:
    door = access()
    cookie = door.login(door.token("viewer"))
    assert cookie is not None
    role, expiry, signature = cookie.split(".")
    assert door.role_of(f"operator.{expiry}.{signature}") is None
    assert door.role_of(f"{role}.{int(expiry) + 1}.{signature}") is None


def test_a_cookie_expires() -> None:
    now = [1e9]
    door = access(clock=lambda: now[0])
    cookie = door.login(door.token("viewer"))
    now[0] += 13 * 3600
    assert door.role_of(cookie) is None


def test_operators_beyond_loopback_need_tls() -> None:
    open_door = access(host="0.0.0.0")
    assert open_door.roles == ("viewer",)
    assert "TLS" in str(open_door.refusal)
    assert open_door.login(open_door.token("operator")) is None
    assert access(host="0.0.0.0", tls=True).roles == ("operator", "viewer")
    assert access(host="::1").refusal is None


def test_viewer_only_offers_no_operator() -> None:
    door = access(viewer_only=True)
    assert door.login(door.token("operator")) is None
    assert door.roles == ("viewer",)


def test_an_operator_cookie_is_invalid_on_a_server_for_viewers() -> None:
    cookie = access().login(access().token("operator"))
    assert access(viewer_only=True).role_of(cookie) is None


@pytest.mark.parametrize("host", ["127.0.0.1:8710", "localhost:8710", "[::1]:8710", "localhost:9"])
def test_loopback_names_are_own_hosts(host: str) -> None:
    assert access().is_own_host(host)


@pytest.mark.parametrize(
    "host", ["", "evil.example", "evil.example:8710", "10.0.0.1", "127.0.0.1.x"]
)
def test_other_names_are_not_own_hosts(host: str) -> None:
    assert not access().is_own_host(host)


def test_beyond_loopback_addresses_are_own_hosts_but_names_of_others_are_not() -> None:
    door = access(host="0.0.0.0")
    assert door.is_own_host("192.168.1.5:8710")
    assert door.is_own_host("[fe80::1]:8710")
    assert not door.is_own_host("evil.example:8710")


@pytest.mark.parametrize(
    ("origin", "is_own"),
    [
        ("http://localhost:8710", True),
        ("http://localhost:3000", False),
        ("https://localhost:8710", False),
        ("null", False),
        ("", False),
    ],
)
def test_only_the_own_origin_is_accepted(origin: str, is_own: bool) -> None:
    headers = {"host": "localhost:8710", "origin": origin}
    assert access().is_own_origin(headers) == is_own


def test_the_key_is_kept_in_a_private_file(tmp_path: Path) -> None:
    key = load_key(tmp_path)
    assert len(key) == 32
    assert load_key(tmp_path) == key
    assert (tmp_path / "dashboard-key").stat().st_mode & 0o777 == 0o600
    assert load_key(tmp_path, renew=True) != key


def test_a_key_that_others_can_read_is_refused(tmp_path: Path) -> None:
    load_key(tmp_path)
    (tmp_path / "dashboard-key").chmod(0o644)
    with pytest.raises(PermissionError, match="not private"):
        load_key(tmp_path)


def test_a_link_instead_of_the_key_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(bytes(32))
    (tmp_path / "dashboard-key").symlink_to(tmp_path / "other")
    with pytest.raises(OSError, match="dashboard-key"):
        load_key(tmp_path)


def test_names_in_host_headers() -> None:
    assert name_of_host("[::1]:80") == "::1"
    assert name_of_host("[::1]") == "::1"
    assert name_of_host("Robot:8710") == "robot"


@pytest.mark.parametrize(
    ("host", "answer"), [("127.0.0.2", True), ("::1", True), ("0.0.0.0", False)]
)
def test_loopback_addresses(host: str, answer: bool) -> None:
    assert is_loopback(host) == answer
