from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.teleoperation.sliding_maximum import SlidingMaximum

STEPS = st.lists(st.tuples(st.integers(0, 5), st.integers(-9, 9)), min_size=1, max_size=50)


@given(STEPS, st.integers(0, 12))
def test_against_all_values_of_the_window(steps: list[tuple[int, int]], window: int) -> None:
    found, now, values = SlidingMaximum(window), 0, []
    for step, value in steps:
        now += step
        values.append((now, value))
        found.add(now, value)
        assert found.value == max(v for time, v in values if time >= now - window)


def test_empty() -> None:
    assert SlidingMaximum(1).value is None
