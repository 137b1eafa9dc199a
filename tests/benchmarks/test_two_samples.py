"""Two-sample statistics against known answers, and on samples that depend on each other."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.two_samples import (
    chi_squared_critical,
    chi_squared_tail,
    compare_rounds,
    effect_of,
    goodness_of_fit,
    quantile_effect,
)


def dependent_rounds(seed: int, rounds: int = 12, cycles: int = 400, spread: float = 1.0):
    """Each round wanders slowly: what a machine does to all cycles of a while."""
    random = np.random.default_rng(seed)
    noise = random.normal(size=(rounds, cycles))
    for number in range(1, cycles):
        noise[:, number] = 0.98 * noise[:, number - 1] + 0.2 * noise[:, number]
    return [spread * row for row in noise]


@pytest.mark.parametrize("degrees", [1, 2, 3, 10, 29, 30])
def test_the_distribution_is_chi_squared(degrees: int) -> None:
    stats = pytest.importorskip("scipy.stats")
    for x in (0.1, 1.0, 20.0, 49.59, 80.0):
        assert chi_squared_tail(x, degrees) == pytest.approx(stats.chi2.sf(x, degrees), rel=1e-9)


def test_the_published_critical_value() -> None:
    assert chi_squared_critical(29, 0.01) == pytest.approx(49.59, abs=0.005)


def test_pearson_of_a_sample_with_itself_is_nothing() -> None:
    values = np.random.default_rng(1).normal(size=3000)
    fit = goodness_of_fit(values, values)
    assert (fit.statistic, fit.degrees) == (0.0, 29)
    assert not fit.differs


def test_pearson_by_hand() -> None:
    """Two bins, around the median 2: 2 expected in each, 1 and 3 found."""
    fit = goodness_of_fit(np.array([1.0, 5, 6, 7]), np.array([1.0, 1.5, 2.5, 3]), bins=2)
    assert fit.statistic == pytest.approx((1 - 2) ** 2 / 2 + (3 - 2) ** 2 / 2)
    assert fit.degrees == 1


def test_one_value_only_leaves_one_bin() -> None:
    assert goodness_of_fit(np.ones(50), np.ones(50)).statistic == 0.0


def test_the_published_test_rejects_a_program_against_itself() -> None:
    """Same process, other rounds: dependence alone makes the statistic large; pairs are not fooled.
    Of twenty such comparisons the one rejects nearly all, the other hardly any."""
    wrong = right = 0
    for seed in range(20):
        a, b = dependent_rounds(seed), dependent_rounds(1000 + seed)
        wrong += goodness_of_fit(np.concatenate(a), np.concatenate(b)).differs
        right += compare_rounds(a, b).verdict == "differs"
    assert wrong >= 18
    assert right <= 1


def test_a_difference_is_seen() -> None:
    found = compare_rounds(dependent_rounds(1), dependent_rounds(2, spread=0.2))
    assert found.verdict == "differs"
    assert found.p_value <= 0.01
    assert 0.1 < found.distance < 1.0


def test_all_signs_are_counted_where_there_are_few_pairs() -> None:
    """Three pairs, all apart: of eight assignments two are as far."""
    found = compare_rounds([np.zeros(5)] * 3, [np.ones(5)] * 3)
    assert found.distance == 1.0
    assert found.p_value == found.least_p_value == 0.25
    assert found.verdict == "too few rounds"


def test_many_pairs_are_drawn_the_same_way_each_time() -> None:
    a, b = dependent_rounds(1, rounds=30), dependent_rounds(2, rounds=30)
    assert compare_rounds(a, b) == compare_rounds(a, b)


def test_pairs_are_needed() -> None:
    with pytest.raises(ValueError, match="pairs"):
        compare_rounds([np.zeros(3)], [])


def test_the_interval_is_that_of_the_sign_test() -> None:
    """Ten pairs: second smallest to second largest covers with 1 - 22/1024."""
    effect = effect_of([3.0, 1, 2, 10, 4, 5, 6, 7, 8, 9])
    assert (effect.estimate, effect.low, effect.high) == (5.5, 2.0, 9.0)
    assert effect.confidence == pytest.approx(1 - 22 / 1024)
    assert effect_of([1.0, 2, 3, 4, 5]).low is None  # the whole range covers with 0.94 only


def test_quantiles_are_compared_round_by_round() -> None:
    one = [np.arange(101.0) + k for k in range(6)]
    other = [np.arange(101.0)] * 6
    assert quantile_effect(one, other, 0.99).estimate == 2.5
