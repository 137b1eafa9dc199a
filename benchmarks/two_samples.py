"""Comparison of the distributions of a duration in two programs.

The module has a test that is valid for loops, an effect with its confidence interval, and the
goodness-of-fit test that is often published instead.

Durations of successive cycles are not independent: the machine may be slow for a while, and a long
period makes the next one short. *Rounds* are independent. Each round is a new process, and the
programs take turns, so round i of both programs meets the same conditions. The unit of the test is
therefore a pair of rounds. A single cycle does not count as independent evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

BINS = 30  # bins of the published test
ALPHA = 0.01  # significance level of both tests
GRID = 512  # points at which distributions are compared
EXACT_PAIRS = 14  # largest number of pairs with all signs; for more, signs are drawn
DRAWN = 19_999
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """Pearson's statistic. Above `critical`, the hypothesis is rejected."""

    statistic: float
    degrees: int
    critical: float

    @property
    def differs(self) -> bool:
        return self.statistic > self.critical


@dataclass(frozen=True, slots=True)
class PairedRounds:
    """Result of the permutation test.

    `distance` is the largest difference between the two distribution functions, 0 to 1
    (Kolmogorov-Smirnov). `p_value` is the probability of a distance at least as large by chance.
    `least_p_value` is the smallest value that this number of pairs can give.
    """

    distance: float
    p_value: float
    least_p_value: float

    @property
    def verdict(self) -> str:
        if self.least_p_value > ALPHA:
            return "too few rounds"
        return "differs" if self.p_value <= ALPHA else "no difference seen"


@dataclass(frozen=True, slots=True)
class Effect:
    """Median over the pairs, and an interval that covers it with at least `confidence`.

    `low` and `high` are None if there are too few pairs.
    """

    estimate: float
    low: float | None
    high: float | None
    confidence: float


def chi_squared_tail(x: float, degrees: int) -> float:
    """Return P(X > x) of a chi-squared distribution.

    The closed form for integer degrees of freedom is from Abramowitz and Stegun, 26.4.4 and 26.4.5.
    """
    if x <= 0:
        return 1.0
    if degrees % 2 == 0:
        term = total = math.exp(-x / 2)
        for i in range(1, degrees // 2):
            term *= x / (2 * i)
            total += term
        return total
    total = math.erfc(math.sqrt(x / 2))
    term = math.sqrt(2 * x / math.pi) * math.exp(-x / 2)
    for i in range(1, (degrees - 1) // 2 + 1):
        total += term
        term *= x / (2 * i + 1)
    return total


def chi_squared_critical(degrees: int, alpha: float = ALPHA) -> float:
    """Return the x with P(X > x) = alpha, by bisection."""
    low, high = 0.0, 1.0
    while chi_squared_tail(high, degrees) > alpha:
        high *= 2
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if chi_squared_tail(middle, degrees) > alpha else (low, middle)
    return high


def goodness_of_fit(sample: Values, reference: Values, bins: int = BINS) -> GoodnessOfFit:
    """Run the published test on the counts of `sample` in bins.

    The counts of `reference` are taken as the known distribution. Each bin holds the same number of
    reference values, and the outer bins are open. Frequent values reduce the number of bins.
    """
    edges = np.unique(np.quantile(reference, np.linspace(0, 1, bins + 1)[1:-1]))
    places = len(edges) + 1
    known = np.bincount(np.searchsorted(edges, reference, "right"), minlength=places)
    observed = np.bincount(np.searchsorted(edges, sample, "right"), minlength=places)
    kept = known > 0
    expected = known[kept] * (len(sample) / len(reference))
    statistic = float((((observed[kept] - expected) ** 2) / expected).sum())
    degrees = max(int(kept.sum()) - 1, 1)
    return GoodnessOfFit(statistic, degrees, chi_squared_critical(degrees))


def compare_rounds(
    ours: Sequence[Values], theirs: Sequence[Values], *, seed: int = 1
) -> PairedRounds:
    """Run a permutation test on whole rounds.

    If the programs are alike, the two rounds of a pair are exchangeable, and all signs of the
    differences are equally likely. The p-value is therefore valid for any dependence within a
    round, and for any number of cycles.

    Args:
        ours: Values of each of our rounds.
        theirs: Values of each of the other program's rounds.
        seed: Seed for the drawn signs.

    Raises:
        ValueError: The numbers of rounds differ or are zero.
    """
    pairs = len(ours)
    if pairs != len(theirs) or not pairs:
        raise ValueError(f"{pairs} and {len(theirs)} rounds are not pairs of rounds")
    everything = np.concatenate([*ours, *theirs])
    grid = np.unique(np.quantile(everything, np.linspace(0, 1, GRID)))
    differences = np.stack(
        [_shares(a, grid) - _shares(b, grid) for a, b in zip(ours, theirs, strict=True)]
    )
    distance = float(abs(differences.mean(axis=0)).max())
    signs = _signs(pairs, seed)
    chance = abs(signs @ differences).max(axis=1) / pairs
    reached = int(np.count_nonzero(chance >= distance * (1 - 1e-12)))
    itself = pairs > EXACT_PAIRS  # add the observed signs, which all signs already contain
    p_value = (reached + itself) / (len(signs) + itself)
    # Inverting all signs gives the same distance.
    return PairedRounds(distance, p_value, max(2.0 ** (1 - pairs), 1 / (len(signs) + 1)))


def _shares(values: Values, grid: Values) -> Values:
    """Return the distribution function at the points of the grid."""
    return np.searchsorted(np.sort(values), grid, "right") / len(values)


def _signs(pairs: int, seed: int) -> Values:
    if pairs <= EXACT_PAIRS:
        return np.array(list(product((1.0, -1.0), repeat=pairs)))
    return np.random.default_rng(seed).choice((1.0, -1.0), size=(DRAWN, pairs))


def effect_of(differences: Sequence[float]) -> Effect:
    """Return the median of the pairs' differences, with the interval of the sign test.

    The interval is from the k-th smallest to the k-th largest difference. It assumes independent
    pairs, but no particular distribution.
    """
    ordered = sorted(differences)
    pairs = len(ordered)
    estimate = float(np.median(ordered))
    k = 0
    while 1 - 2 * _binomial_tail(k, pairs) >= CONFIDENCE and k < pairs // 2:
        k += 1
    if k == 0:
        return Effect(estimate, None, None, 0.0)
    confidence = 1 - 2 * _binomial_tail(k - 1, pairs)
    return Effect(estimate, ordered[k - 1], ordered[-k], confidence)


def _binomial_tail(k: int, n: int) -> float:
    """Return P(at most k heads in n tosses of a coin)."""
    return float(sum(math.comb(n, i) for i in range(k + 1)) / 2**n)


def quantile_effect(ours: Sequence[Values], theirs: Sequence[Values], quantile: float) -> Effect:
    """Return the effect on a quantile: ours minus theirs, round by round."""
    return effect_of(
        [
            float(np.quantile(a, quantile) - np.quantile(b, quantile))
            for a, b in zip(ours, theirs, strict=True)
        ]
    )
