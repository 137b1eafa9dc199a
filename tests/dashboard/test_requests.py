"""Requests of the page to the program of a real loop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

from catenary.dashboard.requests import (
    CALLS_MAX,
    READS,
    VIEWER_CALLS_MAX,
    WRITES,
    BusyError,
    Requests,
    is_allowed,
)
from catenary.remote import Client
from tests.dashboard.serving import Page


def test_every_listed_method_exists() -> None:
    assert all(callable(getattr(Client, method)) for method in READS | WRITES)


@pytest.mark.parametrize("method", sorted(WRITES))
def test_only_operators_may_write(method: str) -> None:
    assert is_allowed(method, "operator")
    assert not is_allowed(method, "viewer")


@pytest.fixture(scope="module")
def called(page: Page) -> Iterator[object]:
    with page.client("viewer") as client:
        yield lambda method, **params: client.post(
            "/api/call", json={"method": method, "params": params}
        )


def test_a_viewer_reads_the_devices(called) -> None:  # type: ignore[no-untyped-def]
    answer = called("devices")
    assert answer.status_code == 200
    assert [device["position"] for device in answer.json()["result"]] == [0, 1]
    assert answer.headers["cache-control"] == "no-store"


def test_too_many_waiting_requests_are_refused_with_a_pause(
    called,  # type: ignore[no-untyped-def]
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("catenary.dashboard.app.VIEWER_CALLS_MAX", 0)
    answer = called("hello")
    assert answer.status_code == 429
    assert answer.json()["error"]["kind"] == "BusyError"
    assert answer.json()["retry"] > 0


def test_bytes_of_an_object_are_base64(called) -> None:  # type: ignore[no-untyped-def]
    result = called("sdo_read", position=0, index=0x1000, type="UDINT").json()["result"]
    assert result["value"] & 0xFFFF == 402
    assert isinstance(result["data"], str)


@pytest.mark.parametrize(
    ("params", "kind"),
    [
        ({"position": 99, "index": 0x1000}, "ValueError"),
        ({"position": 0, "index": 0x5FFF}, "SdoAbort"),
        ({"position": "x", "index": 0x1000}, "ValueError"),
        ({"unknown": 1}, "ValueError"),
        ({"position": 0, "index": 0x1000, "timeout": 1e9}, "ValueError"),
    ],
)
def test_a_refused_request_names_its_error(called, params: dict[str, object], kind: str) -> None:  # type: ignore[no-untyped-def]
    answer = called("sdo_read", **params)
    assert answer.status_code == 400
    assert answer.json()["error"]["kind"] == kind
    assert answer.json()["error"]["message"]
    assert called("hello").status_code == 200  # the connection still works


def test_the_report_contains_the_devices_and_the_plan(page: Page) -> None:
    with page.client("viewer") as client:
        text = client.get("/report.html").text
    assert "not available" not in text
    assert "Catenary virtual servo" in text
    assert "Plan: 2 devices" in text


def test_the_timing_is_sent_to_all_clients(page: Page) -> None:
    with page.socket("viewer") as socket:
        timing = socket.next("timing")
    assert timing["figures"]["lateness"]["count"] > 0  # type: ignore[index]
    assert timing["histograms"]


def test_hello_states_that_the_program_answers(page: Page) -> None:
    with page.socket("viewer") as socket:
        assert socket.next("hello")["remote"] is True


def test_an_event_has_advice_only_if_the_program_knows_one(page: Page) -> None:
    with page.client() as client, page.socket("viewer") as socket:
        body = {"method": "sdo_write", "params": {"position": 0, "index": 0x6065, "subindex": 0}}
        body["params"] |= {"value": 1000, "type": "UDINT"}  # type: ignore[operator]
        written = client.post("/api/call", json=body)
        assert written.status_code == 200, written.text
        event = socket.next("event")
    assert event["kind"] == "RemoteWrite"
    assert isinstance(event["advice"], str)


def test_viewers_leave_room_for_the_requests_of_operators(monkeypatch: pytest.MonkeyPatch) -> None:
    release = threading.Event()

    async def scenario() -> None:
        requests = Requests("none")
        monkeypatch.setattr(requests, "_call", lambda *_: release.wait(30))
        viewers = [
            asyncio.create_task(requests.call("devices", {}, limit=VIEWER_CALLS_MAX))
            for _ in range(VIEWER_CALLS_MAX)
        ]
        await asyncio.sleep(0)
        with pytest.raises(BusyError, match=f"{VIEWER_CALLS_MAX} requests"):
            await requests.call("devices", {}, limit=VIEWER_CALLS_MAX)
        operator = asyncio.create_task(requests.call("set_state", {}, limit=CALLS_MAX))
        release.set()
        assert all(await asyncio.gather(operator, *viewers))
        requests.close()

    asyncio.run(scenario())
