from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.teleoperation.packet import DIGEST_BYTES, HEADER, SIZE_MAX, Codec, Packet
from catenary.teleoperation.refusal import Refusal
from catenary.teleoperation.sample import PeerSample
from tests.teleoperation.sides import KEY, OTHER_KEY

PACKET = Packet(
    0x1122334455667788,
    0x0102030405060708,
    9,
    1_000_000_007,
    999_000_000,
    250_000,
    PeerSample((1.0,), (-0.5,), (2.0,), holding=True, wants_stop=True),
)

# Written by hand from the table of packet.py; IEEE 754: 1.0, -0.5, 2.0
BODY = bytes.fromhex(
    "43 54 45 4c 01 01 05 00"
    "88 77 66 55 44 33 22 11"
    "08 07 06 05 04 03 02 01"
    "09 00 00 00 00 00 00 00"
    "07 ca 9a 3b 00 00 00 00"
    "c0 87 8b 3b 00 00 00 00"
    "90 d0 03 00 00 00 00 00"
    "00 00 00 00 00 00 f0 3f"
    "00 00 00 00 00 00 e0 bf"
    "00 00 00 00 00 00 00 40"
)


def sealed(body: bytes, key: bytes = KEY) -> bytes:
    digest = hashlib.blake2b(body, key=key, digest_size=16, person=b"catenary-teleop1")
    return body + digest.digest()


def changed(offset: int, data: bytes) -> bytes:
    """Return the golden packet with other bytes and a valid digest."""
    return sealed(BODY[:offset] + data + BODY[offset + len(data) :])


def test_golden_bytes() -> None:
    assert Codec(KEY, 1).encode(PACKET) == sealed(BODY)
    assert Codec(KEY, 1).decode(sealed(BODY)) == PACKET


def test_arrays_are_sent_as_they_are() -> None:
    sample = PeerSample(np.array([1.0]), np.array([-0.5]), np.array([2.0]), True, False, True)
    assert Codec(KEY, 1).encode(PACKET._replace(sample=sample)) == sealed(BODY)


@dataclass(frozen=True)
class Case:
    data: bytes
    refusal: Refusal


@pytest.mark.parametrize(
    "case",
    [
        Case(b"", Refusal.FORMAT),
        Case(sealed(BODY)[:-1], Refusal.KEY),
        Case(sealed(BODY) + b"\0", Refusal.KEY),
        Case(sealed(BODY + bytes(8)), Refusal.FORMAT),
        Case(changed(0, b"HTTP"), Refusal.FORMAT),
        Case(changed(4, b"\x02"), Refusal.VERSION),
        Case(changed(5, b"\x02"), Refusal.AXES),
        Case(sealed(BODY, OTHER_KEY), Refusal.KEY),
        Case(changed(56, struct.pack("<d", float("nan"))), Refusal.NOT_FINITE),
        Case(changed(64, struct.pack("<d", float("inf"))), Refusal.NOT_FINITE),
    ],
)
def test_a_packet_is_refused(case: Case) -> None:
    assert Codec(KEY, 1).decode(case.data) is case.refusal


@given(st.integers(0, len(BODY) + DIGEST_BYTES - 1), st.integers(1, 255))
def test_each_changed_byte_is_refused(place: int, flip: int) -> None:
    data = bytearray(sealed(BODY))
    data[place] ^= flip
    assert isinstance(Codec(KEY, 1).decode(bytes(data)), Refusal)


@given(st.binary(max_size=SIZE_MAX + 1), st.integers(1, 16))
def test_random_bytes_are_refused(data: bytes, axes: int) -> None:
    assert isinstance(Codec(KEY, axes).decode(data), Refusal)
    assert isinstance(Codec(KEY, axes).decode(b"CTEL\x01" + data), Refusal)


@given(st.binary(min_size=HEADER.size - 5, max_size=SIZE_MAX - DIGEST_BYTES), st.integers(1, 16))
def test_bytes_of_a_holder_of_the_key_never_raise(data: bytes, axes: int) -> None:
    found = Codec(KEY, axes).decode(sealed(b"CTEL\x01" + data))
    assert isinstance(found, Packet | Refusal)


def samples(axes: int) -> st.SearchStrategy[PeerSample]:
    numbers = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * axes)
    return st.builds(
        PeerSample, numbers, numbers, numbers, st.booleans(), st.booleans(), st.booleans()
    )


WORDS, TIMES = st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1)


@given(st.integers(1, 16).flatmap(samples), WORDS, WORDS, WORDS, TIMES, TIMES, st.booleans())
def test_round_trip(sample, session, answers, sequence, sent, echo, leaving) -> None:
    codec = Codec(KEY, len(sample.position))
    packet = Packet(session, answers, sequence, sent, echo, 5, sample, leaving)
    data = codec.encode(packet)
    assert len(data) == codec.size <= SIZE_MAX
    assert codec.decode(data) == packet


@pytest.mark.parametrize("axes", [0, 17])
def test_number_of_axes(axes: int) -> None:
    with pytest.raises(ValueError, match="1 to 16"):
        Codec(KEY, axes)


@pytest.mark.parametrize("key", [b"", b"secret", bytes(33)])
def test_length_of_the_key(key: bytes) -> None:
    with pytest.raises(ValueError, match=f"32 bytes, not {len(key)}"):
        Codec(key, 2)


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        (PeerSample((0.0,), (0.0,), ()), "expected 1"),
        (PeerSample((0.0, 0.0), (0.0,), (0.0,)), "expected 1"),
        (PeerSample((float("nan"),), (0.0,), (0.0,)), "not finite"),
    ],
)
def test_an_invalid_sample_is_not_sent(sample: PeerSample, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Codec(KEY, 1).encode(PACKET._replace(sample=sample))


def test_one_number_is_not_a_sequence() -> None:
    packet = Packet(1, 0, 1, 0, 0, 0, PeerSample(0.1, 0.0, 0.0))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="sequences with 1 numbers"):
        Codec(bytes(32), 1).encode(packet)
