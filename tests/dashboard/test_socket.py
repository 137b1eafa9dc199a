"""WebSocket of a running server, beside a real loop in another process."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from tests.dashboard.serving import Page, Socket, running_loop, serving
from tests.share.processes import comes_true


def test_hello_describes_the_share(page: Page) -> None:
    with page.socket() as socket:
        hello = socket.next("hello")
    assert hello["share"] == page.hub.source.name
    assert hello["role"] == "operator"
    layout = hello["layout"]
    assert isinstance(layout, dict)
    assert layout["period"] == 1e-3
    assert len(layout["axes"]) == 2
    position = next(each for each in layout["fields"] if each["name"] == "position")
    assert position == {"name": "position", "unit": "rad", "shape": [2], "per_axis": True}


def test_status_follows_the_cycles(page: Page) -> None:
    with page.socket("viewer") as socket:
        first, second = socket.next("status"), socket.next("status")
    assert int(str(second["number"])) > int(str(first["number"]))
    assert first["state"] == "running"
    axis = first["axes"][0]  # type: ignore[index]
    assert axis["state"] == "OPERATION_ENABLED"
    assert axis["enabled"] is True
    assert axis["jogged"] is False
    assert abs(axis["position"]) < 10.0
    assert axis["fault"] == axis["stop_reason"] == ""


def test_pong_repeats_the_time(page: Page) -> None:
    with page.socket("viewer") as socket:
        socket.send("ping", t=1.5)
        assert socket.next("pong")["t"] == 1.5


def test_a_full_subscription_has_every_cycle(page: Page) -> None:
    with page.socket() as socket:
        socket.send("subscribe", id=7, signals=["number", "position[1]"], full=True, rate=30)
        frames = [socket.frame() for _ in range(20)]
    assert {(frame.kind, frame.id, frame.lost) for frame in frames} == {(1, 7, 0)}
    numbers = np.concatenate([frame.values[0] for frame in frames])
    np.testing.assert_array_equal(numbers, numbers[0] + np.arange(len(numbers)))
    assert [frame.first for frame in frames] == [int(frame.values[0][0]) for frame in frames]
    assert np.isfinite(frames[0].values[1]).all()
    assert len(numbers) > 100


def test_a_decimated_subscription_has_minimum_and_maximum(page: Page) -> None:
    with page.socket() as socket:
        socket.send("subscribe", id=1, signals=["number"], full=False, rate=20)
        frames = [socket.frame() for _ in range(5)]
    assert {(frame.kind, frame.rows) for frame in frames} == {(2, 1)}
    bounds = np.array([frame.values[0, 0] for frame in frames])
    np.testing.assert_array_equal(bounds[1:, 0], bounds[:-1, 1] + 1)  # nothing is skipped
    assert (bounds[:, 1] >= bounds[:, 0]).all()
    assert bounds[-1, 1] - bounds[0, 0] > len(bounds)  # frames have several cycles


def test_equal_subscriptions_share_their_frames(page: Page) -> None:
    with page.socket() as one, page.socket("viewer") as two:
        for number, socket in enumerate((one, two)):
            socket.send("subscribe", id=number, signals=["number"], full=True, rate=60)
            socket.frame()
        subscriptions = page.hub.subscriptions
        assert subscriptions is not None
        assert subscriptions.group_count == 1
        one.send("subscribe", id=5, signals=["position[0]"], full=True, rate=60)
        assert comes_true(lambda: subscriptions.group_count == 2)
        one.send("unsubscribe", id=5)
        assert comes_true(lambda: subscriptions.group_count == 1)
    assert comes_true(lambda: subscriptions.group_count == 0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"op": "unknown"}',
        '{"op": "subscribe", "id": -1, "signals": ["number"], "full": true}',
        '{"op": "subscribe", "id": 1, "signals": [], "full": true}',
        '{"op": "subscribe", "id": 1, "signals": ["number"], "full": true, "rate": 1e9}',
        '{"op": "press", "axis": 0, "velocity": 1, "token": "x", "press": 1}',
        "[" * 10_000,
    ],
)
def test_invalid_messages_get_an_error(page: Page, text: str) -> None:
    with page.socket() as socket:
        socket.connection.send(text)
        assert "not valid" in str(socket.next("error")["message"])


def test_an_unknown_signal_gets_an_error_with_its_name(page: Page) -> None:
    with page.socket() as socket:
        socket.send("subscribe", id=1, signals=["position[99]"], full=True)
        error = socket.next("error")
    assert error["about"] == "subscribe"
    assert "position[99]" in str(error["message"])


@pytest.mark.parametrize(
    ("op", "content"),
    [
        ("stop", {}),
        ("press", {"axis": 0, "velocity": 0.1, "token": "1", "press": 1}),
        ("beat", {"axis": 0, "token": "1", "press": 1}),
        ("release", {"axis": 0, "press": 1}),
        ("request", {"axes": None, "state": "disable"}),
    ],
)
def test_a_viewer_cannot_command(page: Page, op: str, content: dict[str, object]) -> None:
    with page.socket("viewer") as socket:
        socket.send(op, **content)
        error = socket.next("error")
        assert error["about"] == op
        assert "only operators" in str(error["message"])
        status = socket.next("status")
    assert status["axes"][0]["enabled"]  # type: ignore[index]


def test_a_flood_of_messages_ends_the_connection(page: Page) -> None:
    with page.socket("viewer") as hostile, page.socket("viewer") as other:
        with pytest.raises(ConnectionClosed) as closed:
            flood(hostile)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1008
        assert other.next("status")["state"] == "running"


def test_a_large_message_ends_the_connection(page: Page) -> None:
    with page.socket("viewer") as socket:
        socket.connection.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            socket.next("pong")


def test_without_a_cookie_the_connection_ends(page: Page) -> None:
    url = page.url.replace("http", "ws") + "/ws"
    with connect(url, origin=page.url) as socket, pytest.raises(ConnectionClosed) as closed:  # type: ignore[arg-type]
        socket.recv(10)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008


@pytest.mark.parametrize("origin", ["http://evil.example", None])
def test_a_socket_of_another_site_is_refused(page: Page, origin: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(page.url.replace("http", "ws") + "/ws", origin=origin)  # type: ignore[arg-type]
    assert refused.value.response.status_code == 403


def test_too_many_clients_are_refused(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.dashboard.hub.CLIENTS_MAX", len(page.hub.clients) + 1)
    with page.socket() as first:
        first.next("hello")
        with page.socket() as second, pytest.raises(ConnectionClosed) as closed:
            second.next("hello")
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1013


def test_a_killed_program_is_reported_and_its_successor_is_found(name: str) -> None:
    with serving(name) as page, page.socket() as socket:
        assert name in str(socket.next("gone")["reason"])
        with running_loop(name, 2) as loop:
            before = socket.next("hello")
            loop.kill()
            assert "has died" in str(socket.next("gone")["reason"])
        with running_loop(name, 3):
            after = socket.next("hello")
            assert len(after["layout"]["axes"]) == 3  # type: ignore[index]
            assert after["run"] != before["run"]
            socket.send("subscribe", id=1, signals=["position[2]"], full=True)
            assert socket.frame().lost == 0


def test_a_stopped_program_is_reported_as_stalled(name: str) -> None:
    with running_loop(name) as loop, serving(name) as page, page.socket() as socket:
        socket.next("status")
        os.kill(loop.process.pid, signal.SIGSTOP)
        try:
            stalled = until(socket, "stalled")
            assert float(str(stalled["silent"])) >= 0.5
        finally:
            os.kill(loop.process.pid, signal.SIGCONT)
        until(socket, "running")


def flood(socket: Socket) -> None:
    """Send messages until the server ends the connection."""
    for _ in range(100_000):
        socket.send("ping", t=0)
    socket.next("never")


def until(socket: Socket, state: str) -> dict[str, object]:
    """Return the first status with a state."""
    while (status := socket.next("status"))["state"] != state:
        assert status["state"] in ("running", "stalled")
    return status


def test_all_signals_of_33_axes_arrive_without_a_lost_sample(name: str) -> None:
    fields = ("position", "velocity", "torque", "commanded_position", "target_position")
    signals = [f"{field}[{axis}]" for field in (*fields, "statusword") for axis in range(33)]
    with running_loop(name, 33) as _, serving(name) as page, page.socket() as socket:
        socket.next("hello")
        socket.send("subscribe", id=1, signals=["number", *signals], full=True, rate=30)
        frames = [socket.frame() for _ in range(60)]
    assert {frame.values.shape[0] for frame in frames} == {199}
    numbers = np.concatenate([frame.values[0] for frame in frames])
    np.testing.assert_array_equal(numbers, numbers[0] + np.arange(len(numbers)))
    assert sum(frame.lost for frame in frames) == 0
