"""Served segments: invalid options, rings on two interfaces, faults and failures."""

from __future__ import annotations

import os
import signal
import socket
import time

import pytest

from catenary.errors import LinkError
from catenary.realtime import private_network
from catenary.virtual import Coupler, FaultEvent, Segment, Served, Server, serve_all
from catenary.virtual.faults import cut
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame

ETHERCAT = 0x88A4
BRD = encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")])


def ring() -> Segment:
    return Segment([Coupler() for _ in range(3)], ring=True, clock="monotonic")


def wire(interface: str) -> socket.socket:
    packet = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
    packet.bind((interface, ETHERCAT))
    packet.settimeout(20.0)
    return packet


def answer(at: socket.socket) -> int:
    """Return the working counter of the next frame from the segment."""
    while True:
        data, (_name, _protocol, kind, *_rest) = at.recvfrom(2048)
        if kind != socket.PACKET_OUTGOING:
            return decode_frame(data).datagrams[0].working_counter


def test_virtual_time_cannot_be_served() -> None:
    with pytest.raises(ValueError, match="real time"):
        Server(Segment([Coupler()]), "veth0")


def test_only_a_ring_has_two_interfaces() -> None:
    with pytest.raises(ValueError, match="requires a ring"):
        Server(Segment([Coupler()], clock="monotonic"), "veth0", second="veth1")


def test_ring_needs_two_different_interfaces(veth: tuple[str, str]) -> None:
    with pytest.raises(LinkError, match="cannot be both ends"):
        Server(ring(), veth[0], second=veth[0])


def test_frames_leave_a_ring_at_the_other_interface(veth: tuple[str, str]) -> None:
    segment = ring()
    with (
        private_network.veth_pair() as other,
        Server(segment, veth[1], second=other[1], max_age=None),
        wire(veth[0]) as first,
        wire(other[0]) as second,
    ):
        first.send(BRD)
        assert answer(second) == 3
        second.send(BRD)
        assert answer(first) == 0
        segment.wires.plug_cable(1, False, at_once=True)
        first.send(BRD)
        second.send(BRD)
        assert (answer(first), answer(second)) == (1, 2)


def test_ring_on_one_interface_is_a_line(veth: tuple[str, str]) -> None:
    with Server(ring(), veth[1], max_age=None), wire(veth[0]) as first:
        first.send(BRD)
        assert answer(first) == 3


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_failed_application_ends_the_server(
    veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    segment = ring()

    def fail() -> int:
        raise ArithmeticError("of the application")

    monkeypatch.setattr(segment.service, "run", fail)
    with Server(segment, veth[1]) as server, pytest.raises(ArithmeticError, match="application"):
        raise_failure_soon(server)


def raise_failure_soon(server: Server) -> None:
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        server.raise_failure()


def test_served_segment_plays_faults(veth: tuple[str, str]) -> None:
    segment = Segment(
        [Coupler() for _ in range(3)], clock="monotonic", faults=[cut(between=(0, 1), at=0.01)]
    )
    with Server(segment, veth[1], max_age=None), wire(veth[0]) as first:
        first.settimeout(0.5)  # frames in the dark cable are lost
        counters = []
        while not counters or counters[-1] != 1:
            first.send(BRD)
            try:
                counters.append(answer(first))
            except TimeoutError:
                counters.append(None)
            assert len(counters) < 100_000
    assert counters[0] == 3
    assert set(counters) <= {3, None, 1}


def test_several_segments_in_one_process(veth: tuple[str, str]) -> None:
    """Both answer until SIGTERM. Faults of both are reported."""
    first = Segment([Coupler()], clock="monotonic")
    second = Segment([Coupler(), Coupler()], clock="monotonic")
    counters, reported = [], []

    def ready() -> None:
        for near in (veth[0], one[0]):
            with wire(near) as link:
                link.send(BRD)
                counters.append(answer(link))
        second.inject(cut(between=(0, 1)))

    def on_fault(event: FaultEvent) -> None:
        reported.append(event.fault.kind)
        os.kill(os.getpid(), signal.SIGTERM)

    with private_network.veth_pair() as one:
        served = [Served(first, veth[1]), Served(second, one[1])]
        serve_all(served, max_age=None, ready=ready, on_fault=on_fault)
    assert counters == [1, 2]
    assert reported == ["cut"]


def test_no_segment_is_served_if_an_interface_is_missing(veth: tuple[str, str]) -> None:
    first, second = (Segment([Coupler()], clock="monotonic") for _ in range(2))
    with pytest.raises(LinkError, match="no network interface 'absent'"):
        serve_all([Served(first, veth[1]), Served(second, "absent")])
    with wire(veth[0]) as near:
        near.settimeout(0.2)
        near.send(BRD)
        with pytest.raises(TimeoutError):
            answer(near)


def test_forked_child_does_not_end_the_server(veth: tuple[str, str]) -> None:
    segment = Segment([Coupler()], clock="monotonic")
    with Server(segment, veth[1], max_age=None) as server, wire(veth[0]) as first:
        child = os.fork()
        if child == 0:
            server.stop()
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
        first.send(BRD)
        assert answer(first) == 1
