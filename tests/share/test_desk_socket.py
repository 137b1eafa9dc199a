"""Socket that sends clients the memory for commands: answers, silent servers and timeouts."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.errors import ShareError
from catenary.share import desk_socket
from catenary.share.desk_socket import DeskSocket, request_descriptor
from catenary.share.memory import make_sealed, map_sealed

SIZE = 4096


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Path]:
    descriptor, memory = make_sealed("test", SIZE)
    memory[:5] = b"hello"
    serving = DeskSocket(tmp_path, descriptor, 0o600)
    serving.publish(tmp_path / "socket-x")
    yield tmp_path / "socket-x"
    serving.close()


def test_each_client_gets_the_same_memory(served: Path) -> None:
    first, second = (map_sealed(request_descriptor(served, os.geteuid()), SIZE) for _ in range(2))
    assert first[:5] == second[:5] == b"hello"
    first[0:1] = b"j"
    assert second[:5] == b"jello"


def test_server_of_another_user_is_refused(served: Path) -> None:
    with pytest.raises(ShareError, match=f"user {os.geteuid()} answers on"):
        request_descriptor(served, os.geteuid() + 1)


def test_client_that_does_not_read_does_not_delay_others(served: Path) -> None:
    silent = [socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(8)]
    for each in silent:
        each.connect(str(served))
    os.close(request_descriptor(served, os.geteuid()))
    for each in silent:
        each.close()


def test_client_retries_while_the_queue_is_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the queue is full, the kernel refuses a client at once, regardless of its timeout."""
    monkeypatch.setattr(desk_socket, "TIMEOUT", 0.02)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as full:
        full.bind(str(tmp_path / "socket-x"))
        full.listen(0)
        first = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        first.connect(str(tmp_path / "socket-x"))
        with pytest.raises(ShareError, match="Resource temporarily unavailable"):
            request_descriptor(tmp_path / "socket-x", os.geteuid())
        monkeypatch.setattr("time.sleep", lambda seconds: full.accept()[0].close())
        with pytest.raises(ShareError, match="timed out"):  # connected, but without an answer
            request_descriptor(tmp_path / "socket-x", os.geteuid())
        first.close()


def test_socket_of_a_killed_process_refuses_connections(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as left:
        left.bind(str(tmp_path / "socket-x"))
    with pytest.raises(ShareError, match="does not answer: Connection refused"):
        request_descriptor(tmp_path / "socket-x", os.geteuid())
    with pytest.raises(FileNotFoundError):
        request_descriptor(tmp_path / "socket-y", os.geteuid())


def test_silent_server_times_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk_socket, "TIMEOUT", 0.02)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as silent:
        silent.bind(str(tmp_path / "socket-x"))
        silent.listen(1)
        with pytest.raises(ShareError, match="does not answer: timed out"):
            request_descriptor(tmp_path / "socket-x", os.geteuid())


def test_close_removes_the_socket(tmp_path: Path) -> None:
    descriptor, _ = make_sealed("test", SIZE)
    serving = DeskSocket(tmp_path, descriptor, 0o600)
    assert [path.name[:7] for path in tmp_path.iterdir()] == [".draft-"]
    serving.publish(tmp_path / "socket-x")
    assert [path.name for path in tmp_path.iterdir()] == ["socket-x"]
    serving.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("change", [lambda d: os.ftruncate(d, 0), lambda d: os.ftruncate(d, 9999)])
def test_memory_cannot_be_resized(change: object) -> None:
    descriptor, _ = make_sealed("test", SIZE)
    with pytest.raises(PermissionError):
        change(descriptor)  # type: ignore[operator]
    with pytest.raises(ShareError, match=f"has {SIZE} bytes .* expected 64"):
        map_sealed(descriptor, 64)
