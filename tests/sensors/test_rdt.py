"""Records are packed here by their offsets, independently of the decoder."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.sensors.rdt import Rdt


def record(sequence: int, force: int = 0, torque: int = 0, *, status: int = 0, tick: int = 0):
    words = [sequence, tick, status, force, 0, 0, torque, 0, 0]
    return b"".join((word % 2**32).to_bytes(4, "big") for word in words)


@pytest.fixture
def box():
    made = Rdt(500.0)
    made.start()
    return made


def test_the_box_starts_and_stops_with_the_requests_of_the_manual():
    assert Rdt(500.0).start() == (bytes.fromhex("1234 0002 00000000"),)
    assert Rdt(500.0).stop() == (bytes.fromhex("1234 0000 00000000"),)


def test_the_bias_is_set_only_at_the_first_start():
    box = Rdt(500.0, set_bias=True)
    assert box.start()[0] == bytes.fromhex("1234 0042 00000000")
    assert box.start() == (bytes.fromhex("1234 0002 00000000"),)  # the sensor may be loaded now


def test_counts_become_newton_and_newton_metre():
    box = Rdt(500.0, counts_per_force=1000.0, counts_per_torque=100.0)
    (sample,) = box.feed(record(1, force=-1500, torque=25), 0)
    assert sample.values["force"] == [-1.5, 0.0, 0.0]
    assert sample.values["torque"] == [0.25, 0.0, 0.0]
    assert sample.valid


def test_a_record_with_a_status_is_invalid_and_names_it(box):
    (sample,) = box.feed(record(1, status=0x80000004), 0)
    assert not sample.valid
    assert "0x80000004" in sample.reason
    assert sample.values["status"] == 0x80000004


def test_lost_records_are_counted(box):
    for number in (1, 2, 6):
        box.feed(record(number), 0)
    assert box.counters.lost == 3


def test_a_reordered_or_repeated_record_is_dropped(box):
    taken = [len(box.feed(record(number), 0)) for number in (1, 3, 2, 3, 4)]
    assert taken == [1, 1, 0, 0, 1]
    assert box.counters.reordered == 2


@pytest.mark.parametrize("last", [5, 5000])
def test_a_restarted_box_begins_again_with_1(box, last):
    box.feed(record(last), 0)
    assert len(box.feed(record(1), 0)) == 1
    assert box.counters.restarts == 1
    assert len(box.feed(record(2), 0)) == 1


def test_the_sequence_wraps(box):
    for number in (2**32 - 1, 0, 1):
        assert len(box.feed(record(number), 0)) == 1
    assert (box.counters.lost, box.counters.restarts) == (0, 0)


def test_a_datagram_may_contain_several_records(box):
    assert len(box.feed(record(1) + record(2) + record(3), 0)) == 3


def test_the_sequence_of_the_sensor_gives_the_time():
    box = Rdt(500.0, sequence_rate=7000.0)
    box.start()
    first, second = box.feed(record(1, tick=2**32 - 7) + record(2, tick=7), 0)
    assert second.time_ns - first.time_ns == 2_000_000


@given(st.binary(max_size=200))
def test_any_datagram_is_decoded_or_counted(data):
    box = Rdt(500.0)
    samples = box.feed(data, 0)
    assert len(data) == box.counters.garbage or len(samples) <= len(data) // 36
    if len(data) % 36:
        assert samples == []


@pytest.mark.parametrize("number", [0.0, -1.0])
def test_rates_and_counts_must_be_positive(number):
    with pytest.raises(ValueError, match="must be positive"):
        Rdt(number)
    with pytest.raises(ValueError, match="must be positive"):
        Rdt(500.0, counts_per_force=number)
