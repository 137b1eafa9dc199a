from __future__ import annotations

import select
import signal
import socket
import subprocess
import sys

import pytest

from catenary.teleoperation import LinkState, NetworkModel, Peer, UdpTransport
from catenary.teleoperation import relay as relay_module
from catenary.teleoperation.relay import Relay, main, side
from tests.teleoperation.sides import KEY, SAMPLE

MS = 1_000_000


def ports(count: int) -> list[int]:
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    found = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return found


def arrived(transport: UdpTransport) -> bytes | None:
    select.select([transport], [], [], 10.0)
    return transport.receive()


class Setting:
    """Two ends, and the addresses of a relay between them."""

    def __init__(self) -> None:
        one, other, relay_one, relay_other = (f"127.0.0.1:{port}" for port in ports(4))
        self.words = [f"{relay_one}={one}", f"{relay_other}={other}"]
        self.ends = UdpTransport(one, relay_one), UdpTransport(other, relay_other)


def test_packets_are_forwarded_after_their_delay() -> None:
    setting = Setting()
    near, far = side(setting.words[0]), side(setting.words[1])
    relay = Relay((near, far), NetworkModel(delay=0.005))
    setting.ends[0].send(b"there")
    setting.ends[1].send(b"back")
    select.select([near], [], [], 10.0)
    select.select([far], [], [], 10.0)
    relay.step(0)
    relay.step(5 * MS - 1)
    assert (relay.received, relay.forwarded) == (2, 0)
    relay.step(5 * MS)
    assert (relay.received, relay.forwarded) == (2, 2)
    assert arrived(setting.ends[1]) == b"there"
    assert arrived(setting.ends[0]) == b"back"


class Flood:
    """Transport with an endless number of packets."""

    def receive(self) -> bytes:
        return b"flood"


def test_a_flood_neither_blocks_the_relay_nor_fills_its_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(relay_module, "WAITING_MAX", 3000)
    relay = Relay((Flood(), Flood()), NetworkModel(delay=1.0))
    relay.step(0)
    assert relay.received == 2000
    relay.step(1)
    assert (relay.received, relay.waiting) == (4000, 3000)


def test_the_program_connects_two_peers_and_ends_on_a_signal() -> None:
    setting = Setting()
    command = [sys.executable, "-m", "catenary.teleoperation.relay", *setting.words]
    command += ["--delay", "0.002", "--seed", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline().startswith("relay at 127.0.0.1:")
        peers = [Peer(each, key=KEY, axes=2, max_delay=10.0, settle=0.0) for each in setting.ends]
        for _ in range(100):
            for number, peer in enumerate(peers):
                peer.send(SAMPLE)
                select.select([setting.ends[1 - number]], [], [], 10.0)
                peers[1 - number].receive()
            if all(peer.state is LinkState.CONNECTED for peer in peers):
                break
        assert [peer.state for peer in peers] == [LinkState.CONNECTED] * 2
        assert all(peer.round_trip >= 0.004 for peer in peers)
        program.send_signal(signal.SIGTERM)
        output, _ = program.communicate(timeout=60)
    assert program.returncode == 0
    assert output.startswith("received ")


def test_the_program_ends_after_its_time(capsys: pytest.CaptureFixture[str]) -> None:
    handler = signal.getsignal(signal.SIGTERM)
    try:
        assert main([*Setting().words, "--seconds", "0.01"]) == 0
    finally:
        signal.signal(signal.SIGTERM, handler)
    assert "received 0, forwarded 0 packets" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["a:1", "b:2"], "RELAY=SIDE"),
        (["127.0.0.1:0=x", "b:2"], "HOST:PORT"),
        (["127.0.0.1:0=127.0.0.1:9", "127.0.0.1:0=127.0.0.1:9", "--loss", "2"], "loss 2.0"),
    ],
)
def test_invalid_arguments(words: list[str], message: str, capsys) -> None:
    assert main(words) == 2
    assert message in capsys.readouterr().err
