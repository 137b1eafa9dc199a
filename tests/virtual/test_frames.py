"""Random frames are answered, refused or ignored, and never cause a crash."""

from __future__ import annotations

import struct

from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.virtual import AnalogInputs, Coupler, DigitalOutputs, Segment, Servo
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame

HEADER = bytes(6) + b"\x00\x01\x02\x03\x04\x05" + b"\x88\xa4"


def segment() -> Segment:
    return Segment([Coupler(), Servo(axes=2), DigitalOutputs(), AnalogInputs()])


@settings(max_examples=300)
@given(st.binary(max_size=1500))
def test_any_bytes_after_the_ethernet_header(body: bytes) -> None:
    line = segment()
    returned = line.core.pass_frame(HEADER + body)
    assert returned is None or len(returned) == len(HEADER) + len(body)


def loops_are_set(line: Segment) -> bool:
    """Return True if the frame can write loop control, after which frames may be lost."""
    return any(line.core.peek(k, 0x0101, 1) != b"\0" for k in range(len(line)))


DATAGRAM = st.tuples(
    st.integers(0, 16),
    st.integers(0, 0xFFFF_FFFF) | st.integers(0, 0x3200).map(lambda ado: ado << 16),
    st.binary(max_size=200),
)


@settings(max_examples=150)
@given(st.lists(st.lists(DATAGRAM, min_size=1, max_size=5), max_size=8))
def test_any_datagrams_to_any_register(
    frames: list[list[tuple[int, int, bytes]]],
) -> None:
    line = segment()
    link = line.open_link()
    for datagrams in frames:
        body = b""
        for n, (command, address, data) in enumerate(datagrams):
            more = 0x8000 if n + 1 < len(datagrams) else 0
            body += struct.pack("<BBIHH", command, n, address, len(data) | more, 0) + data + b"\0\0"
        link.send(HEADER + struct.pack("<H", len(body) | 0x1000) + body)
        link.wait_until(link.now() + 2_000_000, True)
        assert link.receive() is not None or loops_are_set(line)
    link.wait_until(link.now() + 20_000_000, False)


def test_frame_with_an_excessive_length_is_not_processed() -> None:
    line = segment()
    body = struct.pack("<BBIHH", EcatCommand.BRD, 1, 0, 100, 0) + bytes(12)
    frame = HEADER + struct.pack("<H", len(body) | 0x1000) + body
    returned = line.core.pass_frame(frame)
    assert returned is not None
    assert returned[14:] == frame[14:]
    assert line.frames.malformed == 1


def test_datagrams_before_a_malformed_one_are_processed() -> None:
    line = segment()
    good = struct.pack("<BBIHH", EcatCommand.BRD, 1, 0, 1 | 0x8000, 0) + bytes(3)
    broken = struct.pack("<BBIHH", EcatCommand.BRD, 2, 0, 1000, 0) + bytes(3)
    frame = HEADER + struct.pack("<H", len(good + broken) | 0x1000) + good + broken
    returned = line.core.pass_frame(frame)
    assert returned is not None
    assert returned[16 + 11 : 16 + 13] == b"\x04\x00"
    assert returned[16 + 13 :] == frame[16 + 13 :]


def test_foreign_frames_do_not_return() -> None:
    line = segment()
    assert line.core.pass_frame(HEADER[:12] + b"\x08\x00" + bytes(46)) is None
    assert line.frames.foreign == 1


def test_datagrams_of_a_frame_are_processed_in_order() -> None:
    line = segment()
    datagrams = [
        Datagram(EcatCommand.APWR, 0x0010_0000, b"\x34\x12"),
        Datagram(EcatCommand.FPRD, 0x0010_1234, bytes(2)),
    ]
    returned = line.core.pass_frame(encode_frame(datagrams))
    assert returned is not None
    first, second = decode_frame(returned).datagrams
    assert (first.working_counter, second.working_counter, second.data) == (1, 1, b"\x34\x12")
