"""Hostile clients: garbage, many connections, clients that never read, floods."""

from __future__ import annotations

import random
import socket
import struct
import time
from collections.abc import Iterator

import pytest

from catenary.gateway import clients
from catenary.gateway.clients import TcpClient
from catenary.gateway.limits import BURST, CLIENTS, FRAME_TIMEOUT, OUTSTANDING, RATE
from tests.gateway.line import Line
from tests.gateway.tool import COE, Tool

UPLOAD = struct.pack("<HBHB4x", 0x2000, 0x40, 0x1018, 4)
FRAME = struct.pack("<HHHBB", 5 << 12 | 16, 10, 0x1002, 0, COE) + UPLOAD
PATIENCE = 60.0  # [s] for a machine under load


def connect(line: Line) -> socket.socket:
    found = socket.create_connection(("127.0.0.1", line.gateway.port), timeout=PATIENCE)
    found.settimeout(PATIENCE)
    return found


def is_closed(connected: socket.socket) -> bool:
    try:
        return connected.recv(4096) == b""
    except ConnectionError:
        return True


def still_serves(line: Line) -> bool:
    """Return True if a well-behaved client is served; wait until the others have gone."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        with line.tool() as tool:
            try:
                return tool.upload(0x1018, 4) == bytes(4)
            except (ConnectionError, BrokenPipeError):  # no place yet
                time.sleep(0.01)
    return False


def test_a_thousand_connections(line: Line) -> None:
    for _ in range(1000):
        connect(line).close()
    assert still_serves(line)
    assert line.gateway.counts.connections >= 1000
    assert len(line.gateway.clients) <= CLIENTS


def test_connections_beyond_the_limit_are_closed(line: Line) -> None:
    held = [line.tool() for _ in range(CLIENTS)]
    for tool in held:
        assert tool.upload(0x1018, 4) == bytes(4)
    with connect(line) as other:
        assert is_closed(other)
    assert held[0].upload(0x1018, 4) == bytes(4)
    for tool in held:
        tool.socket.close()
    assert line.gateway.counts.rejected == 1
    assert still_serves(line)


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"POST / HTTP/1.1\r\n\r\n",
        bytes(100),
        b"\xff" * 3000,
        struct.pack("<H", 5 << 12 | 5) + bytes(5),  # shorter than a mailbox header
        struct.pack("<HHHBB", 5 << 12 | 6, 500, 0x1002, 0, COE),  # lying length
        struct.pack("<HHHBB", 5 << 12 | 6, 0, 0x1002, 0, 9),  # unknown protocol
    ],
    ids=["GET", "POST", "zeros", "ones", "short", "lying", "protocol 9"],
)
def test_garbage_closes_the_connection(line: Line, data: bytes) -> None:
    with connect(line) as other:
        other.sendall(data)
        assert is_closed(other)
    assert line.gateway.counts.invalid == line.gateway.counts.disconnected == 1
    assert line.gateway.counts.requests == 0
    assert still_serves(line)


def test_random_bytes(line: Line) -> None:
    chance = random.Random(24)
    with line.tool(udp=True) as datagrams:
        for number in range(300):
            size = chance.randrange(1, 200)
            data = bytearray(chance.randbytes(size))
            if number % 2 and size > 8:  # a valid frame with a random message
                data[:8] = struct.pack("<HHHBB", 5 << 12 | size - 2, size - 8, 0x1002, 0, 3)
            datagrams.socket.send(data)
            if number % 10 == 0:
                with connect(line) as other:
                    other.sendall(data)
    assert still_serves(line)
    assert line.main.subs[1].sdo.read(0x1018, 4) == bytes(4)


def test_random_messages_of_a_client_that_may_write(line: Line) -> None:
    chance = random.Random(8200)
    with line.tool() as tool:
        for _ in range(150):
            kind = chance.choice((1, 2, 3, 3, 3, 4, 4, 5, 15))
            data = bytearray(chance.randbytes(chance.randrange(0, 60)))
            if kind == 3 and len(data) > 3:
                data[:2] = struct.pack("<H", chance.choice((2, 3, 5, 8)) << 12)
            tool.send(kind, bytes(data))
            if kind in (3, 4) and len(data) < 2:
                tool.receive()  # these are always answered
    assert still_serves(line)
    assert line.main.subs[1].sdo.read(0x1018, 4) == bytes(4)
    assert line.main.subs[2].sdo.read(0x1018, 4) == bytes(4)


def send_for_ever(connected: socket.socket, frame: bytes) -> None:
    while True:
        connected.sendall(frame)


def test_a_client_that_never_reads(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "STALL_TIMEOUT", 0.2)
    request = struct.pack("<HBxHH", 0x8000, 1, 0, 1)  # a list, which is longer than the request
    mailbox = struct.pack("<HHBB", len(request), 0x1002, 0, COE) + request
    frame = struct.pack("<H", len(mailbox) | 5 << 12) + mailbox
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        other.settimeout(PATIENCE)
        other.connect(("127.0.0.1", line.gateway.port))
        with pytest.raises(ConnectionError):
            send_for_ever(other, frame)
    assert line.gateway.counts.disconnected == 1
    assert still_serves(line)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, TcpClient]]:
    """Yield a socket, and the client at its other end at the time 0."""
    own, connected = socket.socketpair()
    with own, connected:
        yield own, TcpClient(connected, ("127.0.0.1", 1), 0.0)


def test_the_rate_of_a_stream_is_bounded(pair: tuple[socket.socket, TcpClient]) -> None:
    own, client = pair
    accepted = 0
    own.sendall(FRAME * 2000)
    for step in range(2000):
        now = step * 1e-3
        client.receive(now)
        while client.wants(now) and client.next_message(now) is not None:
            accepted += 1
    assert BURST + 1.9 * RATE < accepted <= BURST + 2 * RATE


def test_a_frame_may_wait_while_requests_have_no_answer(
    pair: tuple[socket.socket, TcpClient],
) -> None:
    """The device is slow, not the client."""
    own, client = pair
    own.sendall(FRAME + FRAME[:5])
    client.receive(0.0)
    assert client.next_message(0.0) is not None
    client.outstanding = OUTSTANDING
    assert not client.is_late(2 * FRAME_TIMEOUT)
    client.outstanding = 0
    assert not client.is_late(2.5 * FRAME_TIMEOUT)
    assert client.is_late(3.5 * FRAME_TIMEOUT)


def test_a_flood_of_datagrams_is_bounded(line: Line) -> None:
    with line.tool(udp=True) as tool:
        for _ in range(3000):
            tool.send(COE, UPLOAD)
        assert still_serves(line)
        assert line.gateway.counts.requests < 3000


def test_many_addresses_of_udp(line: Line) -> None:
    for _ in range(5 * CLIENTS):
        with Tool(line.gateway.port, udp=True) as tool:
            assert tool.upload(0x1018, 4) == bytes(4)
    assert len(line.gateway.clients) <= CLIENTS
