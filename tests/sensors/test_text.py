"""Lines of text: CSV and sentences in the style of NMEA 0183."""

from __future__ import annotations

from functools import reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.sensors.sensor import Channel
from catenary.sensors.text import Column, Text, TimeColumn

RATES = Column(Channel("angular_velocity", "rad/s", (3,)), (1, 2, 3), scale=0.5)
TEMPERATURE = Column(Channel("temperature", "K"), (4,))
FIRST = b"the rest of a line\n"


def csv(**options) -> Text:
    return Text([RATES, TEMPERATURE], rate=100.0, count=5, **options)


def sentence(body: str) -> bytes:
    """Return a sentence with the checksum of NMEA 0183."""
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}\r\n".encode()


def test_columns_become_channels() -> None:
    (sample,) = csv().feed(FIRST + b"7, 1.0,-2,+3e0, 300.5\r\n", 0)
    assert sample.values == {"angular_velocity": (0.5, -1.0, 1.5), "temperature": 300.5}
    assert sample.time_ns is None


def test_a_sentence_of_nmea_0183() -> None:
    """The sentence is the usual example of GGA, with its checksum 47."""
    line = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
    height = Column(Channel("height", "m"), (9,))
    gps = Text([height], rate=1.0, count=15, prefix="$GPGGA")
    (sample,) = gps.feed(line, 0)
    assert sample.values == {"height": 545.4}
    assert gps.feed(line.replace(b"545", b"546"), 0) == []
    assert gps.counters.bad_checksums == 1


def test_other_sentences_are_ignored() -> None:
    imu = csv(prefix="$PIMU", checksum=True)
    assert imu.feed(sentence("PGPS,1,2,3,4"), 0) == []
    assert len(imu.feed(sentence("PIMU,1,2,3,4"), 0)) == 1
    assert imu.counters.bad_messages == 0


def test_a_required_checksum_that_is_missing() -> None:
    imu = csv(prefix="$PIMU", checksum=True)
    assert imu.feed(FIRST + b"$PIMU,1,2,3,4\n", 0) == []
    assert imu.counters.bad_messages == 1


def test_the_first_line_may_be_incomplete() -> None:
    """The line was "0,1,2,3,14.5", of which only the end arrives as five columns at times."""
    sensor = csv()
    assert sensor.feed(b"0,1,2,3,4\n", 0) == []
    assert len(sensor.feed(b"0,1,2,3,4\n", 0)) == 1
    sensor.start()
    assert sensor.feed(b"0,1,2,3,4\n", 0) == []


@pytest.mark.parametrize(
    "line",
    [
        *(b"0,1,2,3", b"0,1,2,3,4,5", b"0,1,2,,4", b"0,1,2,x,4", b"0,1,2,nan,4", b"0,1,2,inf,4"),
        *(b"0,1,2,1_0,4", b"0,1,2,0x10,4", b"0,1,2,1e999,4", b"0 1 2 3 4"),
    ],
)
def test_lines_that_are_no_samples(line: bytes) -> None:
    sensor = csv()
    assert sensor.feed(FIRST + line + b"\n", 0) == []
    assert sensor.counters.bad_messages == 1


def test_garbage_is_counted() -> None:
    sensor = csv()
    sensor.feed(FIRST, 0)
    before = sensor.counters.garbage
    assert sensor.feed(b"0,1,\xff2,3,4\n", 0) == []
    assert sensor.counters.garbage == before + 11


def test_a_stream_without_line_ends_is_bounded() -> None:
    sensor = csv()
    for _ in range(100):
        assert sensor.feed(b"x" * 100, 0) == []
    assert sensor.counters.garbage > 9_000
    assert len(sensor._rest) <= 1024


def test_the_time_of_the_device() -> None:
    sensor = csv(time=TimeColumn(0, unit_ns=1000.0))
    (sample,) = sensor.feed(FIRST + b"1500,1,2,3,4\n", 0)
    assert sample.time_ns == 1_500_000


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_any_bytes_are_decoded_or_counted(pieces: list[bytes]) -> None:
    sensor = csv(time=TimeColumn(0, unit_ns=1e9))
    for piece in pieces:
        sensor.feed(piece, 0)
    sensor.feed(b"\n", 0)
    assert len(sensor.feed(b"0,1,2,3,4\n", 0)) == 1


@given(st.integers(1, 12))
def test_bytes_arrive_in_pieces(size: int) -> None:
    stream = FIRST + b"1,1,2,3,4\r\n2,5,6,7,8\r\n"
    whole, pieces = csv(), csv()
    found = [
        sample
        for at in range(0, len(stream), size)
        for sample in pieces.feed(stream[at : at + size], 0)
    ]
    assert found == whole.feed(stream, 0)
    assert len(found) == 2


@pytest.mark.parametrize(
    "make",
    [
        lambda: Column(Channel("a", "", (3,)), (1, 2)),
        lambda: Column(Channel("a"), (-1,)),
        lambda: Text([RATES], rate=1.0, count=3),
        lambda: Text([RATES], rate=0.0, count=5),
        lambda: Text([], rate=1.0, count=5),
        lambda: csv(separator=""),
        lambda: csv(time=TimeColumn(5, 1.0)),
    ],
)
def test_arguments_that_cannot_work(make) -> None:
    with pytest.raises(ValueError, match=r"needs|columns|separator"):
        make()
