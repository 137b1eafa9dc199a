from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.remote.limits import RateLimit


def test_a_burst_is_followed_by_the_rate() -> None:
    limit = RateLimit(rate=100.0, burst=2.0)
    assert [limit.wait_for(0.0) for _ in range(3)] == [0.0, 0.0, 0.01]
    assert limit.wait_for(0.0101) == 0.0


@given(st.lists(st.floats(0.0, 0.1), min_size=1, max_size=300))
def test_the_rate_is_never_exceeded(pauses: list[float]) -> None:
    limit, now, accepted = RateLimit(rate=200.0, burst=40.0), 0.0, 0
    for pause in pauses:
        now += pause
        accepted += limit.wait_for(now) == 0.0
    assert accepted <= 40 + 200 * now + 1


def test_a_clock_that_jumps_back_gives_nothing() -> None:
    limit = RateLimit(rate=100.0, burst=1.0)
    assert limit.wait_for(10.0) == 0.0
    assert limit.wait_for(5.0) > 0.0
