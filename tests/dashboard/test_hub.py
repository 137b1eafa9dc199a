"""Hub without a server: reasons, advice and damaged shares."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from catenary.dashboard.hub import CLIENTS_MAX, RESERVED, Hub
from catenary.dashboard.outbox import Outbox
from catenary.dashboard.requests import Requests
from catenary.dashboard.security import Role
from catenary.dashboard.source import Source
from catenary.errors import ShareError
from catenary.share import SharedEvent


class Viewer:
    """Client without a browser."""

    def __init__(self) -> None:
        self.role: Role = "viewer"
        self.outbox = Outbox()

    def reason_no_jog(self) -> str | None:
        return "this link is for viewers"

    def follow_motion(self) -> None:
        """Do nothing: a viewer has no jogs."""

    def forget_motion(self) -> None:
        """Do nothing: a viewer has no jogs."""


async def messages(client: Viewer) -> list[dict[str, Any]]:
    found = []
    while client.outbox.size:
        found.append(json.loads(await client.outbox.next()))
    return found


class Answers(Requests):
    """Requests that a program would answer with these events."""

    def __init__(self, advice: dict[int, str]) -> None:
        super().__init__("none")
        self._advice = advice

    async def call(self, method: str, params: object, *, timeout: float | None = None) -> object:
        if method != "events":
            raise ShareError("no service")
        return {"events": [{"serial": k, "advice": text} for k, text in self._advice.items()]}


def event(serial: int) -> SharedEvent:
    return SharedEvent(serial, 1, "LinkLost", f"event {serial}", 1.0, None, {})


def test_each_new_reason_is_sent_once(name: str) -> None:
    async def scenario() -> list[dict[str, Any]]:
        problem = ["starting"]
        hub, client = Hub(Source(name), Requests(name), lambda: problem[0]), Viewer()
        assert hub.add(client)
        for _ in range(3):
            hub.step(0.0)
        problem[0] = "failed"
        for _ in range(3):
            hub.step(0.0)
        return await messages(client)

    reasons = [message["reason"] for message in asyncio.run(scenario())]
    assert list(dict.fromkeys(reasons)) == ["starting", "failed"]
    assert reasons.count("failed") == 1


@pytest.mark.parametrize(
    ("advice", "expected"),
    [({1: "replug it", 2: "check it"}, ["replug it", "check it"]), ({}, ["", ""])],
)
def test_events_are_sent_with_the_advice_of_the_program(
    name: str, advice: dict[int, str], expected: list[str]
) -> None:
    async def scenario() -> list[dict[str, Any]]:
        hub, client = Hub(Source(name), Answers(advice)), Viewer()
        assert hub.add(client)
        await hub._send_events([event(1), event(2)])
        assert [row["serial"] for row in hub.event_rows()] == [1, 2]
        return await messages(client)

    sent = [message for message in asyncio.run(scenario()) if message["op"] == "event"]
    assert [message["advice"] for message in sent] == expected
    assert [message["message"] for message in sent] == ["event 1", "event 2"]


def test_events_of_a_program_that_does_not_answer_are_sent_without_advice(name: str) -> None:
    async def scenario() -> list[dict[str, Any]]:
        hub, client = Hub(Source(name), Requests(name)), Viewer()
        assert hub.add(client)
        await hub._send_events([event(7)])
        return await messages(client)

    sent = [message for message in asyncio.run(scenario()) if message["op"] == "event"]
    assert [(message["serial"], message["advice"]) for message in sent] == [(7, "")]


def test_an_unexpected_error_detaches_from_the_share_and_is_reported(
    name: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A hub that ended would leave pages with old values that look current."""

    async def scenario() -> list[dict[str, Any]]:
        hub, client = Hub(Source(name), Requests(name)), Viewer()
        assert hub.add(client)
        with monkeypatch.context() as patched:
            patched.setattr(hub, "step", lambda now: {}["missing"])
            hub._step_or_drop(0.0)
        hub._send_reason()
        return await messages(client)

    last = asyncio.run(scenario())[-1]
    assert last["op"] == "gone"
    assert "missing" in last["reason"]
    assert "cannot show the share" in caplog.text


def test_viewers_leave_room_for_operators(name: str) -> None:
    async def scenario() -> None:
        hub = Hub(Source(name), Requests(name))
        viewers = [Viewer() for _ in range(CLIENTS_MAX)]
        assert sum(hub.add(viewer) for viewer in viewers) == CLIENTS_MAX - RESERVED
        operator = Viewer()
        operator.role = "operator"
        assert hub.add(operator)

    asyncio.run(scenario())
