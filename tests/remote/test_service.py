"""The service with hostile clients. Each test ends with a request of an ordinary client."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import msgspec
import pytest

from catenary.errors import BusyError
from catenary.remote import connect, service
from catenary.remote.connection import decode_response, encode_request, open_connection
from catenary.remote.limits import RateLimit
from catenary.remote.messages import MESSAGE_SIZE, VERSION, Request, Response
from catenary.remote.service import CLIENTS, PENDING_EACH
from tests.remote.programs import Running, program

SERVO = 1


@pytest.fixture(autouse=True)
def still_serving(running: Running) -> Iterator[None]:
    yield
    with connect(running.name, timeout=20.0) as client:
        assert len(client.devices()) == 3
        assert client.hello().background


@pytest.fixture
def hostile(running: Running) -> Iterator[socket.socket]:
    with open_connection(running.name, None) as found:
        found.settimeout(10.0)
        yield found


def answers(connection: socket.socket, count: int) -> list[Response]:
    return [decode_response(connection.recv(MESSAGE_SIZE)) for _ in range(count)]


def patient_answer(connection: socket.socket, message: bytes) -> Response:
    """Repeat a request while earlier tests have used up the limit."""
    while True:
        connection.send(message)
        (answer,) = answers(connection, 1)
        if answer.error is None or answer.error.kind != "BusyError":
            return answer
        time.sleep(float(answer.error.details["retry"] or 0.0))


def test_random_bytes_are_refused_one_by_one(hostile: socket.socket) -> None:
    source = random.Random(7)
    for _ in range(30):
        hostile.send(source.randbytes(source.randint(1, 400)))
        (answer,) = answers(hostile, 1)
        assert answer.error is not None


def test_half_a_request_is_refused(hostile: socket.socket) -> None:
    whole = encode_request(1, "sdo_read", 1.0, {"position": SERVO, "index": 0x1000})
    for size in range(1, len(whole), 3):
        hostile.send(whole[:size])
        (answer,) = answers(hostile, 1)
        assert answer.error is not None
        assert answer.error.kind in ("ValueError", "BusyError")


def test_mutated_requests_never_end_the_service(hostile: socket.socket) -> None:
    source = random.Random(3)
    whole = encode_request(1, "timing", 1.0, {"histograms": False})
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[source.randrange(len(damaged))] ^= 1 << source.randrange(8)
        hostile.send(bytes(damaged))
        assert answers(hostile, 1)


def test_a_message_that_is_too_long_ends_the_connection(hostile: socket.socket) -> None:
    hostile.send(bytes(MESSAGE_SIZE + 1))
    assert hostile.recv(MESSAGE_SIZE) == b""


def test_another_version_is_named(hostile: socket.socket) -> None:
    hostile.send(msgspec.msgpack.encode(Request(VERSION + 1, 5, "hello", 1.0)))
    (answer,) = answers(hostile, 1)
    assert answer.serial == 5
    assert answer.error is not None
    assert "version" in answer.error.message


@pytest.mark.parametrize("timeout", [-1.0, float("nan"), float("inf"), 1e9])
def test_an_impossible_deadline_is_refused(hostile: socket.socket, timeout: float) -> None:
    answer = patient_answer(hostile, msgspec.msgpack.encode(Request(VERSION, 5, "hello", timeout)))
    assert answer.error is not None
    assert answer.error.kind == "ValueError"


def test_a_flood_is_answered_with_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "RateLimit", lambda: RateLimit(rate=0.01, burst=5.0))
    message = encode_request(1, "axes", 1.0, {})
    with program() as own, open_connection(own.name, None) as flooding:
        flooding.setblocking(False)
        sent = 0
        for _ in range(10_000):
            try:
                sent += bool(flooding.send(message))
            except BlockingIOError:  # the queue of the socket is full: the sender has to wait
                break
        flooding.settimeout(10.0)
        failures = [answer.error for answer in answers(flooding, min(sent, 30))]
    assert failures[:5] == [None] * 5
    assert {failure.kind for failure in failures[5:] if failure} == {"BusyError"}
    assert None not in failures[5:]


def test_busy_names_the_time_to_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service, "RateLimit", lambda: RateLimit(rate=0.1, burst=1.0))
    with program() as own, connect(own.name, timeout=1.0) as client:
        assert client.axes()
        with pytest.raises(BusyError) as caught:
            client.axes()
    assert 1.0 < caught.value.retry <= 10.0


def test_a_client_repeats_busy_requests(running: Running) -> None:
    with connect(running.name, timeout=10.0) as client:
        for _ in range(60):
            assert client.axes()


def test_a_client_that_never_reads_loses_its_connection(running: Running) -> None:
    with open_connection(running.name, None) as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        silent.settimeout(10.0)
        message = encode_request(1, "objects", 5.0, {"position": SERVO, "count": 500})
        end = time.monotonic() + 20.0
        with pytest.raises(OSError, match=r"Broken pipe|reset by peer"):
            send_until(silent, message, end)


def send_until(connection: socket.socket, message: bytes, end: float) -> None:
    while time.monotonic() < end:
        connection.send(message)


def test_too_many_clients_are_refused(running: Running) -> None:
    opened = [open_connection(running.name, None) for _ in range(CLIENTS + 2)]
    try:
        opened[-1].settimeout(10.0)
        (refusal,) = answers(opened[-1], 1)
        assert refusal.error is not None
        assert "already has" in refusal.error.message
    finally:
        for connection in opened:
            connection.close()


def test_requests_that_wait_do_not_delay_others() -> None:
    read = {"position": SERVO, "index": 0x1000}
    with (
        program(background=False) as own,
        open_connection(own.name, None) as waiting,
        connect(own.name) as client,
    ):
        waiting.settimeout(10.0)
        for serial in range(PENDING_EACH + 1):
            waiting.send(encode_request(serial + 1, "sdo_read", 0.5, read))
        assert client.hello().share == own.name  # answered although the loop stands still
        (refused,) = answers(waiting, 1)
        assert refused.error is not None
        assert refused.error.kind == "BusyError"
        late = answers(waiting, PENDING_EACH)
        assert {each.error.kind for each in late if each.error} == {"ResponseTimeout"}


KILLED = """
import sys
from catenary.remote.connection import encode_request, open_connection
connection = open_connection(sys.argv[1], None)
connection.send(encode_request(1, "objects", 5.0, {"position": 1}))
print("sent", flush=True)
sys.stdin.read()
"""


def test_a_client_that_is_killed_in_the_middle(running: Running) -> None:
    command = [sys.executable, "-c", KILLED, running.name]
    for _ in range(3):
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "sent\n"
            os.kill(process.pid, signal.SIGKILL)


def test_a_forked_child_does_not_keep_connections_open() -> None:
    with program() as own:
        client = connect(own.name)
        assert client.hello().share == own.name
        child = os.fork()
        if child == 0:
            time.sleep(30)
            os._exit(0)
    try:
        with client, pytest.raises(Exception, match="closed the connection"):
            client.hello()
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
