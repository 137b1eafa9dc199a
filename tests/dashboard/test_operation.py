"""Operating modes and presets, from the page to the program of the loop."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from tests.dashboard.serving import Page, Socket, running_loop, serving
from tests.share.names import own_name


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    """Server of a loop that offers modes and presets."""
    with own_name("modes") as name, running_loop(name, 1, "modes"), serving(name) as page:
        yield page


def call(client: httpx.Client, method: str, **params: object) -> httpx.Response:
    return client.post("/api/call", json={"method": method, "params": params})


def error_of(answer: httpx.Response) -> tuple[str, str]:
    assert answer.status_code == 400, answer.text
    found = answer.json()["error"]
    return found["kind"], found["message"]


def mode_becomes(socket: Socket, mode: str) -> bool:
    return any(socket.next("status")["mode"] == mode for _ in range(400))


def test_every_browser_receives_the_modes_and_presets(page: Page) -> None:
    with page.socket("viewer") as socket:
        hello = socket.next("hello")
        assert hello["modes"] == [
            {"name": "damping", "description": "hold softly"},
            {"name": "stand", "description": ""},
            {"name": "balance", "description": ""},
        ]
        assert [each["name"] for each in hello["presets"]] == ["wave", "dance"]  # type: ignore[attr-defined]


def test_an_operator_changes_the_mode_and_all_see_it(page: Page) -> None:
    with page.client() as client, page.socket("viewer") as socket:
        assert call(client, "set_mode", mode="stand").json() == {"result": {"note": ""}}
        assert mode_becomes(socket, "stand")
        assert call(client, "modes").json()["result"]["mode"] == "stand"


def test_an_operator_runs_a_preset(page: Page) -> None:
    with page.client() as client:
        assert call(client, "run_preset", preset="wave").status_code == 200


def test_a_refusal_has_the_reason_of_the_program(page: Page) -> None:
    with page.client() as client:
        answer = call(client, "set_mode", mode="balance")
        assert error_of(answer) == ("RequestRefused", "the robot has fallen")


def test_a_request_without_an_answer_is_reported(page: Page) -> None:
    with page.client() as client:
        kind, message = error_of(call(client, "run_preset", preset="dance"))
        assert kind == "ResponseTimeout"
        assert "within 1 s" in message


def test_an_unknown_mode_is_refused(page: Page) -> None:
    with page.client() as client:
        assert error_of(call(client, "set_mode", mode="<b>\x1b"))[0] == "ValueError"
        assert error_of(call(client, "set_mode", mode=["stand"]))[0] == "ValueError"


def test_a_viewer_sees_the_modes_but_requests_none(page: Page) -> None:
    with page.client("viewer") as client:
        assert call(client, "modes").status_code == 200
        for method, params in (("set_mode", {"mode": "stand"}), ("run_preset", {"preset": "wave"})):
            assert call(client, method, **params).status_code == 403


def test_a_program_without_modes_offers_none(name: str) -> None:
    with running_loop(name, 1), serving(name) as page, page.socket() as socket:
        hello = socket.next("hello")
        assert (hello["modes"], hello["presets"]) == ([], [])
        assert socket.next("status")["mode"] is None
        with page.client() as client:
            kind, message = error_of(call(client, "set_mode", mode="stand"))
            assert (kind, "offers no modes" in message) == ("ValueError", True)
