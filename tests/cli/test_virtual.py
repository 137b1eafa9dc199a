"""`catenary virtual serve`: output and refusals."""

from __future__ import annotations

import signal
import socket
import time

import pytest

from catenary.cli.main import main
from catenary.realtime.child import start_python
from catenary.realtime.system import scheduling
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame

ETHERCAT = 0x88A4
SECONDS = 30.0


def test_dropped_frames_are_reported_at_the_end(veth: tuple[str, str]) -> None:
    """With a maximum age of 0, every frame is too old."""
    ours, theirs = veth
    command = ["-m", "catenary.cli", "virtual", "serve", theirs, "--max-age", "0"]
    with start_python(command) as server, socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as wire:
        assert server.read_line(SECONDS), "the virtual segment did not start"
        wire.bind((ours, ETHERCAT))
        wire.send(encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")]))
        time.sleep(0.1)  # real time on a veth pair, until the frame has arrived
        server.process.send_signal(signal.SIGTERM)
        line = server.read_line(SECONDS)
    assert line == (
        "1 frames waited longer than 0 ms and were dropped; --priority 80 makes this less frequent"
    )


def test_a_refused_priority_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = scheduling.Scheduling("SCHED_OTHER", 0, False, (0,), ("SCHED_FIFO 80 refused",))
    monkeypatch.setattr(scheduling, "request_scheduling", lambda **_: refused)
    assert main(["virtual", "serve", "lo", "--priority", "80"]) != 0
    message = capsys.readouterr().err
    assert "cannot serve lo in real time: SCHED_FIFO 80 refused" in message
    assert "setcap" in message
