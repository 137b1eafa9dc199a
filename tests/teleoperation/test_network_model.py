from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.teleoperation import NetworkModel

MS = 1_000_000
SENT = [k * MS for k in range(5000)]


def arrivals(model: NetworkModel, direction: int = 0) -> list[list[int]]:
    state = model.direction(direction)
    return [state.arrivals(sent) for sent in SENT]


def test_a_perfect_network() -> None:
    assert arrivals(NetworkModel()) == [[sent] for sent in SENT]


def test_the_seed_decides() -> None:
    def of_seed(seed: int, direction: int) -> list[list[int]]:
        return arrivals(NetworkModel(0.01, 0.02, 0.1, 0.1, 0.1, seed=seed), direction)

    assert of_seed(1, 0) == of_seed(1, 0)
    assert len({str(of_seed(seed, direction)) for seed in (1, 2) for direction in (0, 1)}) == 4


@given(st.integers(0, 2**32))
def test_jitter_keeps_the_order_and_the_limits(seed: int) -> None:
    found = [each for (each,) in arrivals(NetworkModel(delay=0.01, jitter=0.005, seed=seed))]
    delays = [each - sent for each, sent in zip(found, SENT, strict=True)]
    assert found == sorted(found)
    assert all(10 * MS <= delay <= 15 * MS for delay in delays)
    assert min(delays) < 11 * MS
    assert max(delays) > 14 * MS  # of 100 nodes: all outside with a probability of 0.8 ** 100


def test_consecutive_packets_have_similar_delays() -> None:
    found = [each for (each,) in arrivals(NetworkModel(delay=0.01, jitter=0.02, seed=8))]
    steps = [after - before for before, after in pairwise(found)]
    assert all(abs(step - MS) <= MS * 20 / 50 for step in steps)


def test_fast_jitter_keeps_the_order_too() -> None:
    found = [each for (each,) in arrivals(NetworkModel(jitter=0.2, seed=8))]
    assert found == sorted(found)


def test_a_tenth_is_lost() -> None:
    lost = sum(not each for each in arrivals(NetworkModel(loss=0.1, seed=5)))
    assert lost == pytest.approx(500, abs=100)  # 4.7 standard deviations
    assert not any(arrivals(NetworkModel(loss=1.0)))


def test_reordered_packets_are_overtaken() -> None:
    found = arrivals(NetworkModel(delay=0.01, reorder=0.05, seed=5))
    late = [each - sent - 10 * MS for (each,), sent in zip(found, SENT, strict=True)]
    assert set(late) - {0}
    assert all(0 <= each <= 10 * MS for each in late)
    assert sum(each > MS for each in late) == pytest.approx(225, abs=70)  # 5 %, 9 of 10 by > 1 ms


def test_duplicates_arrive_not_before_the_first() -> None:
    found = arrivals(NetworkModel(delay=0.01, jitter=0.01, duplicate=0.1, seed=5))
    twice = [each for each in found if len(each) == 2]
    assert len(twice) == pytest.approx(500, abs=100)
    assert all(first <= second for first, second in twice)


def test_outages_count_from_the_first_packet() -> None:
    state = NetworkModel(outages=[(1.0, 1.5)]).direction(0)
    start = 77 * 10**9
    found = [bool(state.arrivals(start + sent)) for sent in SENT]
    assert found == [not 1000 <= k < 1500 for k in range(5000)]


def test_one_property_leaves_the_others_at_the_same_packets() -> None:
    plain = arrivals(NetworkModel(delay=0.01, jitter=0.01, seed=3))
    lossy = arrivals(NetworkModel(delay=0.01, jitter=0.01, loss=0.2, seed=3))
    assert all(other in ([], one) for one, other in zip(plain, lossy, strict=True))


@pytest.mark.parametrize(
    "wrong",
    [
        *({name: value} for name in ("loss", "reorder", "duplicate") for value in (-0.1, 1.1)),
        *({name: value} for name in ("delay", "jitter", "reorder_time") for value in (-1e-3, 61)),
        {"delay": float("nan")},
        {"loss": float("nan")},
        {"outages": [(2.0, 1.0)]},
    ],
)
def test_invalid_numbers(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        NetworkModel(**wrong)
