from __future__ import annotations

import pytest

from catenary.teleoperation.delays import WINDOW_NS, Delays

MS = 1_000_000


@pytest.mark.parametrize("offset", [0, 10**15, -(10**15)])
def test_the_offset_of_the_clocks_cancels(offset: int) -> None:
    """Own packet sent at 0, received there after 3 ms, held for 1 ms, 5 ms on the way back."""
    delays = Delays()
    delays.receive(9 * MS, 4 * MS + offset, 0, 1 * MS)
    delays.update(9 * MS)
    assert delays.sum_ns(9 * MS) == 9 * MS
    assert delays.bound_ns == 9 * MS
    assert delays.round_trip_ns == 8 * MS


def test_the_sum_grows_without_packets() -> None:
    delays = Delays()
    delays.receive(9 * MS, 4 * MS, 0, 0)
    delays.update(29 * MS)
    assert delays.sum_ns(29 * MS) == 29 * MS
    assert delays.bound_ns == 29 * MS


def test_the_bound_is_the_sum_of_the_largest_delays_of_each_direction() -> None:
    """The sum is 22 ms twice: 20 + 2, then 2 + 20. The condition of P+d needs 40 ms."""
    delays = Delays()
    for echo, there, here in ((0, 20, 2), (100, 2, 20)):
        now = (echo + there + here) * MS
        delays.receive(now, (echo + there) * MS, echo * MS, 0)
        delays.update(now)
        assert delays.sum_ns(now) == 22 * MS
    assert delays.bound_ns == 40 * MS


def test_the_bound_forgets_after_the_window() -> None:
    delays = Delays()
    for now, there in ((0, 20), (WINDOW_NS + 1, 1)):
        delays.receive(now, now, now - there * MS, 0)
        delays.update(now)
    assert delays.bound_ns == 1 * MS


def test_unknown_before_the_first_packet() -> None:
    delays = Delays()
    delays.update(5)
    assert (delays.sum_ns(5), delays.bound_ns, delays.round_trip_ns) == (None, None, None)
