"""Requests that share frames."""

from __future__ import annotations

import pytest

from catenary.bus.packing import batches, expected_replies, index_of, make_parcel, replies_of
from catenary.procedure.exchange import Request, read
from catenary.wire.datagram import EcatCommand
from catenary.wire.frame import decode_frame
from catenary.wire.register import AL_STATUS

SHARES = read(EcatCommand.FPRD, 0x1001, AL_STATUS)
ALONE = SHARES._replace(alone=True)


def test_small_requests_share_a_frame() -> None:
    assert batches([SHARES] * 5) == [[0, 1, 2, 3, 4]]


def test_a_request_marked_as_alone_gets_its_own_frame() -> None:
    assert batches([SHARES, ALONE, ALONE, SHARES, SHARES]) == [[0], [1], [2], [3, 4]]


def test_the_fast_path_gives_the_same_replies() -> None:
    requests = [
        Request(EcatCommand.FPRD, 0x0130_1001, bytes(2), True),
        Request(EcatCommand.FPWR, 0x1000_1001, b"abcd", False),
    ]
    parcel = make_parcel(requests, 0x90)
    answered = bytearray(parcel.frame)
    answered[6] |= 0x02  # the first controller
    answered[26:28], answered[28] = b"\x08\x00", 1  # data and working counter
    answered[36] = 0x04  # interrupt of the second datagram
    answered[44] = 1
    raw = bytes(answered)
    expected = replies_of(parcel, decode_frame(raw), 7)
    assert expected_replies(parcel, raw, 7) == expected
    assert expected is not None
    assert [reply.working_counter for reply in expected] == [1, 1]
    assert index_of(raw) == 0x90


@pytest.mark.parametrize("place", [12, 14, 16, 17, 18, 20, 22, 31, 35])
def test_another_frame_takes_the_slow_path(place: int) -> None:
    requests = [
        Request(EcatCommand.FPRD, 0x0130_1001, bytes(2), True),
        Request(EcatCommand.FPWR, 0x1000_1001, b"abcd", False),
    ]
    parcel = make_parcel(requests, 0x90)
    changed = bytearray(parcel.frame)
    changed[place] ^= 0x01
    assert expected_replies(parcel, bytes(changed), 7) is None
    assert expected_replies(parcel, parcel.frame[:-1], 7) is None
    assert expected_replies(parcel, b"", 7) is None
    assert index_of(b"") == -1
