"""Behaviour of SOEM on the virtual segment.

SOEM reads one SII per identity, selects LRW by the SII only, and finds answers by their index
modulo 16 in a socket that is never drained.
"""

from __future__ import annotations

import itertools
import os
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from catenary.virtual import AnalogInputs, Coupler, DigitalOutputs, Segment, Server, Servo
from catenary.virtual.server import NEVER_NS, stamp_arrivals
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.peers.soem import MAX_BUF, OP, Port, Soem

USER_RAM = 0x0F80
PAUSE = 40  # frames that wait in the segment's socket
SECONDS = 30.0


def operate(segment: Segment) -> Soem:
    soem = Soem(segment)
    soem.scan()
    soem.map()
    assert soem.to_operational() == [OP] * len(segment)
    assert soem.exchange() == soem.expected
    return soem


def test_devices_of_one_kind_share_an_sii() -> None:
    one = operate(Segment([Coupler(), Servo()]))
    two = operate(Segment([Coupler(), Servo(), Servo(name="second", alias=7)]))
    assert two.sii_reads == one.sii_reads + 3  # only the identity of the second servo
    assert not two.blocks_lrw


def test_variants_with_different_siis_have_different_identities() -> None:
    """With the same revision, the second servo would get the mailbox of the first (0x0016)."""
    soem = operate(Segment([Servo(), Servo(mailbox_bytes=256), AnalogInputs(mailbox_bytes=64)]))
    assert len({record.identity for record in soem.records}) == 3


@pytest.mark.parametrize("denying", [0, 1, 2])
def test_a_device_without_lrw_reaches_op(denying: int) -> None:
    servos = [Servo(lrw=position != denying) for position in range(3)]
    soem = operate(Segment([*servos, DigitalOutputs(bits=8)]))
    assert soem.blocks_lrw


# -- index modulo 16, without draining


class Wire:
    """One end of a socket pair; the other one belongs to the packet loop."""

    def __init__(self, end: socket.socket, seconds: float) -> None:
        self._end = end
        end.settimeout(seconds)

    def send(self, frame: bytes) -> int:
        return self._end.send(frame)

    def receive(self) -> bytes | None:
        try:
            return self._end.recv(2048)
        except (TimeoutError, BlockingIOError):
            return None


def numbered(number: int) -> bytes:
    """Return a write with the number of its frame in the answer."""
    return encode_frame([Datagram(EcatCommand.BWR, USER_RAM << 16, struct.pack("<I", number))])


def number_in(frame: bytes | None) -> int | None:
    return None if frame is None else struct.unpack("<I", decode_frame(frame).datagrams[0].data)[0]


@contextmanager
def answering(segment: Segment, end: socket.socket, max_age_ns: int) -> Iterator[None]:
    """Run the packet loop of a served segment on a socket."""
    stop = os.eventfd(0)
    thread = threading.Thread(
        target=segment.core.answer_packets, args=(end.fileno(), -1, stop, max_age_ns)
    )
    thread.start()
    try:
        yield
    finally:
        os.eventfd_write(stop, 1)
        thread.join()
        os.close(stop)


def after_a_pause(max_age_ns: int) -> tuple[Segment, Iterator[int | None]]:
    """Stall the segment for PAUSE frames, and return the lag of each answer [frames]."""
    segment = Segment([Coupler()], clock="monotonic")

    def lags() -> Iterator[int | None]:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours, theirs:
            stamp_arrivals(theirs)
            wire = Wire(ours, 0.002)
            port = Port(wire)
            for number in range(PAUSE):
                port.exchange(numbered(number), 0)
            time.sleep(0.005)  # older than max_age on any machine
            ours.settimeout(0.01)
            with answering(segment, theirs, max_age_ns):
                for number in itertools.count(PAUSE):
                    found = number_in(port.exchange(numbered(number), 2 * PAUSE))
                    yield None if found is None else number - found

    return segment, lags()


def test_without_an_age_limit_old_answers_lag_forever() -> None:
    segment, lags = after_a_pause(NEVER_NS)
    assert {lag for lag in itertools.islice(lags, 200)} <= {MAX_BUF, 2 * MAX_BUF, None}
    lags.close()  # type: ignore[attr-defined]
    assert segment.frames.expired == 0


def test_old_frames_are_discarded_and_no_answer_lags() -> None:
    segment, lags = after_a_pause(2_000_000)
    deadline = time.monotonic() + SECONDS
    seen: list[int | None] = []
    while seen[-MAX_BUF:] != [0] * MAX_BUF:
        seen.append(next(lags))
        assert seen[-1] in (0, None), "an old answer was taken for a new one"
        assert time.monotonic() < deadline
    lags.close()  # type: ignore[attr-defined]
    assert segment.frames.expired >= PAUSE
    assert [loss.cause for loss in segment.take_losses()][:PAUSE] == ["expired"] * PAUSE


def test_every_frame_is_too_old_for_an_age_of_0() -> None:
    segment = Segment([Coupler()], clock="monotonic")
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        stamp_arrivals(theirs)
        with answering(segment, theirs, 0):
            deadline = time.monotonic() + SECONDS
            while segment.frames.expired < 3:
                ours.send(numbered(0))
                assert time.monotonic() < deadline
        assert Wire(ours, 0.0).receive() is None
    assert segment.frames.frames == 0


@pytest.mark.parametrize("wrong", [-0.001, float("nan"), float("inf")])
def test_an_impossible_age_is_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match="max_age"):
        Server(Segment([Coupler()], clock="monotonic"), "veth0", max_age=wrong)
