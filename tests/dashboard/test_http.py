"""HTTP routes of a running server."""

from __future__ import annotations

import httpx
import pytest

from tests.dashboard.serving import Page, running_loop, serving

CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)


@pytest.mark.parametrize("path", ["/", "/missing", "/api/session", "/report.html"])
def test_every_answer_has_the_security_headers(page: Page, path: str) -> None:
    with page.client(None) as client:
        headers = client.get(path).headers
    assert headers["content-security-policy"] == CSP
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert "server" not in headers


def test_the_page_has_an_entity_tag_and_is_compressed(page: Page) -> None:
    with page.client(None) as client:
        first = client.get("/")
        assert first.status_code == 200
        assert "Catenary" in first.text
        assert first.headers["content-encoding"] == "gzip"
        again = client.get("/", headers={"If-None-Match": first.headers["etag"]})
    assert again.status_code == 304
    assert again.content == b""


@pytest.mark.parametrize("path", ["/../security.py", "/%2e%2e/security.py", "/static/", "/x/y"])
def test_only_files_of_the_page_are_served(page: Page, path: str) -> None:
    with page.client(None) as client:
        assert client.get(path).status_code == 404


def test_login_sets_a_cookie_that_scripts_cannot_read(page: Page) -> None:
    with page.client(None) as client:
        answer = client.post("/login", json={"token": page.access.token("operator")})
    assert answer.status_code == 204
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"catenary-{page.access.port}=operator.")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert "Secure" not in cookie  # no TLS
    assert "Path=/" in cookie


def test_a_wrong_token_is_refused(page: Page) -> None:
    with page.client(None) as client:
        answer = client.post("/login", json={"token": "wrong"})
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("body", [b"", b"[]", b"{", b'{"token": 1}', b"\xff", b"[" * 5000])
def test_an_invalid_login_is_refused(page: Page, body: bytes) -> None:
    with page.client(None) as client:
        assert client.post("/login", content=body).status_code == 400


def test_a_large_request_is_refused(page: Page) -> None:
    with page.client() as client:
        assert client.post("/api/call", content=b" " * 70_000).status_code == 413


def test_many_wrong_tokens_are_slowed_down() -> None:
    with serving("test-no-such-share") as page, page.client(None) as client:
        statuses = [client.post("/login", json={"token": "x"}).status_code for _ in range(40)]
        assert statuses[0] == 403
        assert statuses[-1] == 429
        right = client.post("/login", json={"token": page.access.token("viewer")})
        assert right.status_code == 204


@pytest.mark.parametrize("path", ["/api/session", "/report.html"])
def test_without_a_session_nothing_is_shown(page: Page, path: str) -> None:
    with page.client(None) as client:
        assert client.get(path).status_code == 401


@pytest.mark.parametrize("path", ["/api/call", "/api/doctor"])
def test_without_a_session_nothing_is_done(page: Page, path: str) -> None:
    with page.client(None) as client:
        assert client.post(path, json={"method": "hello"}).status_code == 401


def test_the_session_states_the_role(page: Page) -> None:
    with page.client("viewer") as client:
        session = client.get("/api/session").json()
    assert session["role"] == "viewer"
    assert session["share"] == page.hub.source.name
    assert session["reason_no_jog"] == "this link is for viewers"


def test_the_session_renews_its_cookie_so_that_an_open_page_stays_valid(page: Page) -> None:
    with page.client("viewer") as client:
        cookie = client.get("/api/session").headers["set-cookie"]
    assert cookie.startswith(f"catenary-{page.access.port}=viewer.")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie


@pytest.mark.parametrize("method", ["sdo_write", "set_state", "home", "virtual_cable", "close", ""])
def test_a_viewer_can_change_nothing(page: Page, method: str) -> None:
    with page.client("viewer") as client:
        answer = client.post("/api/call", json={"method": method, "params": {}})
    assert answer.status_code == 403
    assert "viewer" in answer.json()["error"]["message"]


def test_a_viewer_cannot_load_the_machine_with_an_examination(page: Page) -> None:
    with page.client("viewer") as client:
        assert client.post("/api/doctor").status_code == 403


@pytest.mark.parametrize("method", ["close", "call", "__init__", "move"])
def test_an_operator_can_call_only_listed_methods(page: Page, method: str) -> None:
    with page.client() as client:
        assert client.post("/api/call", json={"method": method}).status_code == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", ""])
def test_requests_of_other_sites_are_refused(page: Page, origin: str) -> None:
    with page.client() as client:
        answer = client.post("/api/call", json={"method": "hello"}, headers={"Origin": origin})
    assert answer.status_code == 403
    assert "another site" in answer.text


def test_a_foreign_host_name_is_refused(page: Page) -> None:
    answer = httpx.get(page.url, headers={"Host": "evil.example"})
    assert answer.status_code == 403
    assert "evil.example" in answer.text


def test_the_report_is_one_file_without_scripts(page: Page) -> None:
    with page.client() as client:
        answer = client.get("/report.html")
    assert answer.status_code == 200
    assert "attachment" in answer.headers["content-disposition"]
    assert page.hub.source.name in answer.text
    assert "<script" not in answer.text


def test_names_of_devices_are_text_in_the_report() -> None:
    from catenary.dashboard.report import as_html

    rendered = as_html([{"name": "<script>alert(1)</script>", "n": [1, {"<b>": None}]}])
    assert "<script>" not in rendered
    assert "<b>" not in rendered
    assert "&lt;script&gt;" in rendered


def test_a_server_without_a_share_states_so(name: str) -> None:
    with serving(name) as page, page.client() as client:
        assert client.get("/").status_code == 200
        assert client.get("/report.html").status_code == 200
        answer = client.post("/api/call", json={"method": "hello"})
        assert answer.status_code == 400
        assert name in answer.json()["error"]["message"]


def test_a_session_stays_valid_after_a_restart_of_the_server(name: str) -> None:
    with running_loop(name):
        with serving(name) as page:
            cookie = page.cookie("operator")
        with serving(name, port=page.access.port) as again:
            answer = httpx.get(f"{again.url}/api/session", headers={"Cookie": cookie})
        assert answer.status_code == 200
