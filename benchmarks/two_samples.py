"""Whether two programs have the same distribution of a duration: a test that holds for samples of
loops, an effect with its interval, and the goodness-of-fit test that is often published instead.

Durations of cycles that follow each other depend on each other: the machine is slow for a while,
and a long period makes the next one short. What is independent are *rounds*: each in a process of
its own, programs in turn, so that round i of one and round i of the other met the same machine.
Here the unit is therefore the pair of rounds, and a cycle is never counted as evidence of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

BINS = 30  # of the published test
ALPHA = 0.01  # of both
GRID = 512  # places at which distributions are compared
EXACT_PAIRS = 14  # of more, signs are drawn
DRAWN = 19_999
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class GoodnessOfFit:
    """Pearson's statistic; beyond `critical` the hypothesis would be rejected."""

    statistic: float
    degrees: int
    critical: float

    @property
    def differs(self) -> bool:
        return self.statistic > self.critical


@dataclass(frozen=True, slots=True)
class PairedRounds:
    """`distance`: the largest between the two distributions (Kolmogorov and Smirnov), 0 to 1.
    `p_value`: how often chance alone makes it as large. `least_p_value`: the smallest that so many
    pairs can give."""

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
    """Median over the pairs, and an interval that covers it with at least `confidence`; without
    bounds where there are too few pairs."""

    estimate: float
    low: float | None
    high: float | None
    confidence: float


def chi_squared_tail(x: float, degrees: int) -> float:
    """P(X > x), in closed form for whole degrees of freedom: Abramowitz and Stegun, 26.4.4 and
    26.4.5."""
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
    """The x with P(X > x) = alpha, by halving."""
    low, high = 0.0, 1.0
    while chi_squared_tail(high, degrees) > alpha:
        high *= 2
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if chi_squared_tail(middle, degrees) > alpha else (low, middle)
    return high


def goodness_of_fit(sample: Values, reference: Values, bins: int = BINS) -> GoodnessOfFit:
    """The published test: counts of `sample` in bins, against those of `reference` as if these
    were known beforehand. The bins hold equally many of the reference, the outer ones are open;
    values that occur often make them fewer."""
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
    """A permutation test on whole rounds. Were the programs alike, the two rounds of a pair could
    as well have been each other's: all signs of the pairs' differences are equally likely. So the
    p-value is right whatever depends on what within a round, for any number of cycles.

    ValueError: the numbers of rounds differ, or there are none."""
    pairs = len(ours)
    if pairs != len(theirs) or not pairs:
        raise ValueError(f"{pairs} rounds and {len(theirs)}: pairs are needed")
    everything = np.concatenate([*ours, *theirs])
    grid = np.unique(np.quantile(everything, np.linspace(0, 1, GRID)))
    differences = np.stack(
        [_shares(a, grid) - _shares(b, grid) for a, b in zip(ours, theirs, strict=True)]
    )
    distance = float(abs(differences.mean(axis=0)).max())
    signs = _signs(pairs, seed)
    chance = abs(signs @ differences).max(axis=1) / pairs
    reached = int(np.count_nonzero(chance >= distance * (1 - 1e-12)))
    itself = pairs > EXACT_PAIRS  # the signs as they came; among all there are, they are already
    p_value = (reached + itself) / (len(signs) + itself)
    # All signs turned round give the same distance.
    return PairedRounds(distance, p_value, max(2.0 ** (1 - pairs), 1 / (len(signs) + 1)))


def _shares(values: Values, grid: Values) -> Values:
    """The distribution function at the places of the grid."""
    return np.searchsorted(np.sort(values), grid, "right") / len(values)


def _signs(pairs: int, seed: int) -> Values:
    if pairs <= EXACT_PAIRS:
        return np.array(list(product((1.0, -1.0), repeat=pairs)))
    return np.random.default_rng(seed).choice((1.0, -1.0), size=(DRAWN, pairs))


def effect_of(differences: Sequence[float]) -> Effect:
    """The median of the pairs' differences, with the interval of the sign test: from the k-th
    smallest to the k-th largest. It assumes that pairs are independent, and no distribution."""
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
    """P(at most k heads in n throws)."""
    return float(sum(math.comb(n, i) for i in range(k + 1)) / 2**n)


def quantile_effect(ours: Sequence[Values], theirs: Sequence[Values], quantile: float) -> Effect:
    """How much larger a quantile of ours is, round by round."""
    return effect_of(
        [
            float(np.quantile(a, quantile) - np.quantile(b, quantile))
            for a, b in zip(ours, theirs, strict=True)
        ]
    )
