"""Jogs and requests of a browser, judged by the state of the virtual servo itself."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from tests.dashboard.serving import Page, Socket, running_loop, serving
from tests.share.processes import comes_true

Condition = Callable[[dict[str, object]], object]


@pytest.fixture
def jogging(name: str) -> Iterator[Page]:
    with running_loop(name, 2, "jog", "still"), serving(name) as page:
        yield page


def status_until(socket: Socket, condition: Condition) -> dict[str, object]:
    """Return the first status whose axis 0 meets a condition."""
    for _ in range(600):
        status = socket.next("status")
        axis: dict[str, object] = status["axes"][0]  # type: ignore[index]
        if condition(axis):
            return axis
    raise AssertionError(f"the condition did not become true: {axis}")


def press(socket: Socket, number: int = 1, **values: object) -> None:
    given = {"axis": 0, "velocity": 0.5, "press": number, "token": socket.next("token")["token"]}
    socket.send("press", **(given | values))


def hold(socket: Socket, number: int, until: Condition) -> dict[str, object]:
    """Echo each token until a jog message or a status meets a condition; return it."""
    for _ in range(3000):
        message = socket.any()
        if message["op"] == "token":
            socket.send("beat", axis=0, press=number, token=message["token"])
        elif until(message):
            return message
    raise AssertionError("the condition did not become true")


def start(socket: Socket) -> int:
    """Press until a jog moves the axis; return its number. A loaded machine lets jogs expire."""
    for number in range(100, 200):
        press(socket, number)
        ended = hold(socket, number, lambda m: is_jogged(m) or has_ended(m))
        if is_jogged(ended):
            return number
    raise AssertionError("no jog moved the axis")


def has_ended(message: dict[str, object]) -> bool:
    return message["op"] == "jog" and message["status"] in ("EXPIRED", "REFUSED_STALE", "REFUSED")


def is_jogged(message: dict[str, object]) -> bool:
    return message["op"] == "status" and bool(message["axes"][0]["jogged"])  # type: ignore[index]


def moved(message: dict[str, object], distance: float) -> bool:
    return message["op"] == "status" and message["axes"][0]["position"] > distance  # type: ignore[index]


def standstill(axis: dict[str, object]) -> bool:
    return not axis["jogged"] and abs(float(str(axis["velocity"]))) < 1e-3


def test_a_jog_moves_while_the_browser_echoes_tokens_and_ends_with_the_release(
    jogging: Page,
) -> None:
    with jogging.socket() as socket:
        press(socket)
        hold(socket, 1, lambda message: moved(message, 0.2))
        socket.send("release", axis=0, press=1)
        assert hold(socket, 1, lambda m: m["op"] == "jog" and m["status"] == "RELEASED")
        axis = status_until(socket, standstill)
        assert float(str(axis["position"])) > 0.2


def test_a_step_ends_at_its_distance(jogging: Page) -> None:
    with jogging.socket() as socket:
        press(socket, distance=0.1)
        assert hold(socket, 1, lambda m: m["op"] == "jog" and m["status"] == "DONE")
        axis = status_until(socket, standstill)
        assert axis["commanded_position"] == pytest.approx(0.1, abs=1e-6)


def test_a_sweep_ends_by_itself(jogging: Page) -> None:
    with jogging.socket() as socket:
        press(socket, velocity=0.2, sweep={"start": 1.0, "end": 20.0, "duration": 0.5})
        assert hold(socket, 1, lambda m: m["op"] == "jog" and m["status"] == "DONE")


def test_an_invalid_sweep_is_refused_with_the_reason(jogging: Page) -> None:
    with jogging.socket() as socket:
        press(socket, sweep={"start": 1.0, "end": 20.0, "duration": 0.0})
        refused = socket.next("jog")
        assert refused["status"] == "REFUSED"
        assert "duration=0.0" in str(refused["text"])


def test_a_silent_browser_stops_the_axis(jogging: Page) -> None:
    with jogging.socket() as socket:
        assert socket.jog_until(start(socket), "EXPIRED")
        status_until(socket, standstill)


def test_old_tokens_extend_nothing(jogging: Page) -> None:
    with jogging.socket() as socket:
        old = socket.next("token")["token"]
        press(socket)
        for _ in range(200):
            message = socket.any()
            if message["op"] == "jog" and message["status"] == "EXPIRED":
                break
            socket.send("beat", axis=0, press=1, token=old)
        else:
            raise AssertionError("the jog did not expire")


def test_a_closed_socket_releases_its_jogs(jogging: Page) -> None:
    with jogging.socket("viewer") as other:
        with jogging.socket() as socket:
            start(socket)
        status_until(other, standstill)
    with jogging.socket() as socket:  # the lease is free, too
        press(socket, distance=0.01)
        assert hold(socket, 1, lambda m: m["op"] == "jog" and m["status"] == "DONE")


@pytest.mark.parametrize("kind", [signal.SIGSTOP, signal.SIGKILL])
def test_a_frozen_or_killed_server_stops_the_axis(name: str, kind: signal.Signals) -> None:
    """The core stops the axis, although the jog has not been released."""
    command = [sys.executable, "-m", "catenary.cli", "dashboard", name, "--port", "0"]
    with running_loop(name, 1, "jog", "still"), cat.attach(name) as reader:
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            line = server.stdout.readline()
            url, _, token = line.removeprefix("operator: ").strip().partition("/#token=")
            with Socket.open(url, token) as socket:
                start(socket)
                server.send_signal(kind)
                assert comes_true(lambda: not reader.read()["jogged"][0])
                position = reader.read()["position"][0]
                server.send_signal(signal.SIGCONT)
                last = reader.number + 300
                assert comes_true(lambda: reader.number > last)
                assert reader.read()["position"][0] == pytest.approx(position, abs=1e-3)
        finally:
            server.send_signal(signal.SIGCONT)
            server.terminate()
            server.wait(60)


def test_two_operators_cannot_move_one_axis(jogging: Page) -> None:
    with jogging.socket() as one, jogging.socket() as two:
        start(one)
        press(two, 5)
        refused = two.next("jog")
        assert (refused["press"], refused["status"]) == (5, "REFUSED")
        assert "leased" in str(refused["text"])


def test_the_stop_of_an_operator_stops_the_axes(jogging: Page) -> None:
    with jogging.socket() as socket:
        start(socket)
        socket.send("stop")
        assert socket.next("stopped")
        axis = status_until(socket, lambda axis: not axis["enabled"] and axis["stop_reason"])
        assert "operator" in str(axis["stop_reason"])


def test_an_operator_disables_and_enables_an_axis(jogging: Page) -> None:
    with jogging.socket() as socket:
        socket.send("request", axes=[0], state="disable")
        status_until(socket, lambda axis: not axis["enabled"])
        socket.send("request", axes=[0], state="enable")
        status_until(socket, lambda axis: axis["enabled"])


def test_a_request_for_the_axes_of_an_earlier_run_is_refused(jogging: Page) -> None:
    """The axis with this number may be another one after a restart of the loop."""
    with jogging.socket() as socket:
        run = socket.next("hello")["run"]
        socket.send("request", axes=[0], state="disable", run="another")
        assert "restarted" in str(socket.next("error")["message"])
        socket.send("request", axes=[0], state="disable", run=run)
        status_until(socket, lambda axis: not axis["enabled"])


def test_a_share_without_jogs_refuses_them_with_the_reason(name: str) -> None:
    with running_loop(name, 1, "still"), serving(name) as page, page.socket() as socket:
        hello = socket.next("hello")
        assert "jog=True" in str(hello["reason_no_jog"])
        socket.send("press", axis=0, velocity=0.1, token="1", press=1)
        assert "REFUSED" in str(socket.next("jog")["status"])


def test_an_unknown_axis_is_refused(jogging: Page) -> None:
    with jogging.socket() as socket:
        press(socket, axis=99)
        assert "axis" in str(socket.next("jog")["text"])
        socket.send("request", axes=[99], state="enable")
        assert "axis" in str(socket.next("error")["message"])
