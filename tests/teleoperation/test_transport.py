from __future__ import annotations

import select
import socket
from collections.abc import Iterator

import pytest

from catenary.errors import LinkError
from catenary.teleoperation import Peer, UdpTransport
from catenary.teleoperation.packet import SIZE_MAX
from catenary.teleoperation.transport import parse_address
from tests.teleoperation.sides import KEY, SAMPLE

SECONDS = 10.0


def has_ipv6() -> bool:
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as made:
            made.bind(("::1", 0))
    except OSError:
        return False
    return True


def free_port(family: int, host: str) -> int:
    with socket.socket(family, socket.SOCK_DGRAM) as made:
        made.bind((host, 0))
        return made.getsockname()[1]


@pytest.fixture(params=["127.0.0.1", "[::1]"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[UdpTransport, UdpTransport]]:
    host: str = request.param
    if "::" in host and not has_ipv6():
        pytest.skip("this machine has no IPv6")
    family = socket.AF_INET6 if "::" in host else socket.AF_INET
    ports = [free_port(family, host.strip("[]")) for _ in range(2)]
    one = UdpTransport(f"{host}:{ports[0]}", f"{host}:{ports[1]}")
    other = UdpTransport(f"{host}:{ports[1]}", f"{host}:{ports[0]}")
    yield one, other
    one.close()
    other.close()


def arrived(transport: UdpTransport) -> bytes | None:
    select.select([transport], [], [], SECONDS)
    return transport.receive()


def test_datagrams_in_both_directions(pair) -> None:
    for one, other in (pair, pair[::-1]):
        assert one.send(b"state")
        assert arrived(other) == b"state"
        assert other.receive() is None


def test_no_call_waits(pair) -> None:
    assert [each._socket.gettimeout() for each in pair] == [0.0, 0.0]


def test_a_longer_datagram_stays_invalid(pair) -> None:
    pair[0].send(bytes(2 * SIZE_MAX))
    assert len(arrived(pair[1])) == SIZE_MAX + 1


def test_datagrams_of_others_are_dropped(pair) -> None:
    host, _, port = pair[0].address.rpartition(":")
    family = socket.AF_INET6 if "::" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"intruder", (host.strip("[]"), int(port)))
    pair[1].send(b"state")
    assert arrived(pair[0]) == b"state"
    assert pair[0].receive() is None


def test_a_closed_port_is_no_error_of_this_program(pair) -> None:
    pair[1].close()
    results = {pair[0].send(b"state") for _ in range(5)}
    assert False in results  # the kernel reports the closed port at the next call
    assert pair[0].receive() is None


def test_peers_over_udp(pair) -> None:
    peers = [Peer(each, key=KEY, axes=2, max_delay=10.0, settle=0.0) for each in pair]
    received = [False, False]
    for _ in range(20):
        for number, peer in enumerate(peers):
            peer.send(SAMPLE)
            select.select([pair[1 - number]], [], [], SECONDS)
            received[1 - number] |= peers[1 - number].receive() == SAMPLE
    assert received == [True, True]


def test_a_port_in_use(pair) -> None:
    with pytest.raises(LinkError, match=r"Address already in use(.|\n)*ss -ulpn"):
        UdpTransport(pair[0].address, pair[1].address)


def test_an_unknown_host() -> None:
    with pytest.raises(LinkError, match=r"cannot send from(.|\n)*check the host names"):
        UdpTransport("127.0.0.1:0", "no-such-host.invalid:7001")


def test_an_address_of_another_machine() -> None:
    with pytest.raises(LinkError, match=r"Cannot assign(.|\n)*bind an address of this machine"):
        UdpTransport("192.0.2.1:0", "127.0.0.1:7001")


def test_the_other_side_needs_a_port() -> None:
    with pytest.raises(ValueError, match="give the port of the other side"):
        UdpTransport("127.0.0.1:0", "127.0.0.1:0")


def test_addresses_of_two_families() -> None:
    with pytest.raises(LinkError, match="one family"):
        UdpTransport("127.0.0.1:0", "[::1]:7001")


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("127.0.0.1:7001", ("127.0.0.1", 7001)),
        ("arm.local:0", ("arm.local", 0)),
        ("[fd00::2]:65535", ("fd00::2", 65535)),
        ("[fe80::1%eth0]:7001", ("fe80::1%eth0", 7001)),
    ],
)
def test_parse_address(text: str, address: tuple[str, int]) -> None:
    assert parse_address(text) == address


@pytest.mark.parametrize("text", ["", "arm", ":7001", "arm:", "arm:x", "::1:7001", "arm:65536"])
def test_an_address_without_port_or_brackets(text: str) -> None:
    with pytest.raises(ValueError, match="HOST:PORT"):
        parse_address(text)
