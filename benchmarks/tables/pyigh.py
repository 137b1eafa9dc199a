"""`python -m benchmarks table pyigh`: the in-controller delay of C, of Python and of compiled laws.

The peers run in rounds and take turns, as in `python -m benchmarks loop`. Two tests of the periods
follow. The published test is Pearson's, with the counts of the C program in 30 bins as the known
distribution. Its conditions are not met:

- Cycles depend on their neighbours: an early one makes the next period long.
- The expected counts are a sample themselves.
- With tens of thousands of cycles, any difference exceeds the critical value, even that of the C
  program from itself.

The other test compares rounds (`benchmarks.two_samples`) and measures the size of the difference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec

import numpy as np

from benchmarks.compiler import has_programs
from benchmarks.loop import BUSY
from benchmarks.peers import modules_of
from benchmarks.tables.published import (
    PYIGH,
    PYIGH_C,
    PYIGH_CHI_SQUARED,
    PYIGH_CONDITIONS,
    Phases,
    spread_of,
)
from benchmarks.tables.sheet import Options, Sheet, as_failures, grid, slashed
from benchmarks.two_samples import (
    Effect,
    GoodnessOfFit,
    PairedRounds,
    Values,
    compare_rounds,
    goodness_of_fit,
    quantile_effect,
)
from catenary.bench.job import PHASES, Body, Round
from catenary.bench.loop import LAW, OURS, ROUND_CYCLES, make_jobs, show_progress
from catenary.bench.rounds import interleave
from catenary.bench.segment import served
from catenary.bench.statistics import Run, combine

DRIVES, RATE, SECONDS = 3, 1000, 10.0
ROUNDS = 10  # minimum: with fewer than 8 pairs, no test at 0.01 can reject
C, C_RING, PYSOEM = "c", "c-ring", "pysoem"
MARGIN_US = 5.0  # a difference that matters
FIELDS = ("period", "receive", "process", "send", "in_controller")
HEADER = ("mean/max/min/sd", "period [ms]", "receive [us]", "process", "send", "in controller")


def measure(options: Options) -> Sheet:
    names, left_out = peers(busy=options.busy_wait > 0)
    seconds = options.seconds or SECONDS
    if options.refused:
        names, left_out = [], [f"all of ours: no private network ({options.refused})"]
    failed: list[str] = []
    found = run(names, seconds, options, failed) if names else {}
    runs = [combine(name, rounds) for name, rounds in found.items()]
    compared = compare(found)
    return Sheet(
        title=f"PyIgH, in-controller delay; {PYIGH_CONDITIONS}",
        conditions=f"ours: {DRIVES} virtual drives on a veth, {RATE} Hz, {seconds:g} s of each",
        text="\n".join([as_table(runs), *as_failures(failed), "", as_tests(compared)]),
        figures={
            "published": {name: phases._asdict() for name, phases in PYIGH.items()},
            "published_chi_squared": PYIGH_CHI_SQUARED,
            "seconds": seconds,
            "runs": [asdict(each) for each in runs],
            "ratios_over_c": ratios(runs),
            "rounds_done_again": failed,
            "comparisons": [
                {**asdict(each), "verdict": each.rounds.verdict, "within": each.within}
                for each in compared
            ],
        },
        left_out=left_out,
    )


def peers(*, busy: bool = False) -> tuple[list[str], list[str]]:
    """Return the peers that this machine can run, and the reasons for omitted ones.

    Args:
        busy: True to include the C program with a busy-wait.
    """
    names, left_out = list(OURS), []
    if find_spec("numba"):
        names.append(LAW)
    else:
        left_out.append(f"{LAW}: Numba is not installed (pip install 'catenary[law]')")
    if find_spec("pysoem"):
        names.append(PYSOEM)
    else:
        left_out.append(f"{PYSOEM}: not installed (pip install 'catenary[peers]')")
    if has_programs():
        return [C, C_RING, *([BUSY] if busy else []), *names], left_out
    return names, [*left_out, f"{C}, {C_RING}: no C compiler (sudo apt install gcc libc6-dev)"]


def run(
    names: Sequence[str], seconds: float, options: Options, failed: list[str]
) -> Mapping[str, list[Round]]:
    cycles = round(seconds * RATE)
    rounds = options.rounds or max(ROUNDS, math.ceil(cycles / ROUND_CYCLES))
    with served(DRIVES) as segment:
        jobs = make_jobs(
            modules_of(names),
            segment,
            RATE,
            math.ceil(cycles / rounds),
            Body.SINE,
            spin=False,
            busy_wait=options.busy_wait,
        )
        published = [replace(job, amplitude=math.pi) for job in jobs]  # pi·sin(pi·t)
        return interleave(published, rounds, show_progress, failed)


# The two tests


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of the periods of two programs."""

    name: str
    pairs: int
    pearson: GoodnessOfFit  # as published
    rounds: PairedRounds
    p99_deviation_us: Effect  # increase of the p99 of |period - T|

    @property
    def within(self) -> str:
        """Verdict on the increase: "yes" if the whole interval is within the margin."""
        effect = self.p99_deviation_us
        if effect.high is None or effect.low is None:
            return "too few rounds"
        if effect.high <= MARGIN_US:
            return "yes"
        return "no" if effect.low > MARGIN_US else "open"


def compare(found: Mapping[str, Sequence[Round]]) -> list[Comparison]:
    """Compare C's odd rounds with its even ones, then each peer with C."""
    if C not in found:
        return []
    theirs = [periods_us(each) for each in found[C]]
    half = len(theirs) // 2 * 2
    compared = []
    if half:
        compared = [comparison("c, odd rounds / even", theirs[1:half:2], theirs[:half:2])]
    for name, rounds in found.items():
        if name != C:
            ours = [periods_us(each) for each in rounds]
            compared.append(comparison(f"{name} / c", ours, theirs))
    return compared


def comparison(name: str, ours: Sequence[Values], theirs: Sequence[Values]) -> Comparison:
    return Comparison(
        name,
        len(ours),
        goodness_of_fit(np.concatenate(ours), np.concatenate(theirs)),
        compare_rounds(ours, theirs),
        quantile_effect(deviations(ours), deviations(theirs), 0.99),
    )


def periods_us(one: Round) -> Values:
    """Return the periods of a round, without the first: it began in another process."""
    return np.asarray(one.samples[1:, PHASES.index("period")] * 1e-3)


def deviations(periods: Sequence[Values]) -> list[Values]:
    return [np.asarray(abs(each - 1e6 / RATE)) for each in periods]


# Text output


def as_table(runs: Sequence[Run]) -> str:
    c = PYIGH[PYIGH_C].in_controller.mean
    rows = [
        row(f"theirs: {name}", each, each.in_controller.mean / c) for name, each in PYIGH.items()
    ]
    over_c = ratios(runs)
    rows += [row(each.name, phases_of(each), over_c.get(each.name)) for each in runs]
    missed = [f"{each.name} {each.lost} of {each.cycles}" for each in runs]
    table = grid((*HEADER, "mean / C's"), rows)
    return "\n".join([table, *([f"cycles lost: {', '.join(missed)}"] if missed else [])])


def phases_of(run: Run) -> Phases:
    first, *others = FIELDS
    return Phases(
        spread_of(run.timing_us[first], 1e-3), *(spread_of(run.timing_us[name]) for name in others)
    )


def row(name: str, phases: Phases, ratio: float | None) -> list[str]:
    texts = [slashed(phases.period, 6), *(slashed(each, 2) for each in phases[1:])]
    return [name, *texts, "-" if ratio is None else f"{ratio:.2f}"]


def ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of the mean in-controller delay to that of C."""
    means = {each.name: each.timing_us["in_controller"]["mean"] for each in runs}
    return {name: round(mean / means[C], 3) for name, mean in means.items() if means.get(C)}


def as_tests(compared: Sequence[Comparison]) -> str:
    published = ", ".join(f"{name} {value}" for name, value in PYIGH_CHI_SQUARED.items())
    lines = [
        f"periods compared with C. Theirs: Pearson's chi-squared {published}, critical 49.59 (29 "
        "degrees, alpha 0.01)."
    ]
    if compared:
        header = ("", "chi-squared (critical)", "pairs of rounds: distance, p")
        effect = f"p99 of |period - T| more [us], at most {MARGIN_US:g}"
        lines += [
            "This test assumes independent cycles and known counts of C, which does not hold: see "
            "C compared with itself. Pairs of rounds are independent.",
            grid((*header, effect), [comparison_row(each) for each in compared]),
        ]
    return "\n".join(lines)


def comparison_row(each: Comparison) -> list[str]:
    fit, rounds, effect = each.pearson, each.rounds, each.p99_deviation_us
    interval = "" if effect.low is None else f" [{effect.low:.1f}, {effect.high:.1f}]"
    return [
        each.name,
        f"{fit.statistic:.0f} ({fit.critical:.2f}) {'differs' if fit.differs else 'same'}",
        f"{rounds.distance:.3f}, {rounds.p_value:.4f} {rounds.verdict}",
        f"{effect.estimate:.1f}{interval} {each.within}",
    ]
