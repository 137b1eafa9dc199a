"""Ratios of our figures to those of the peers in the same run."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from catenary.bench.statistics import IN_CONTROLLER, WAKE_TO_SENT, WITH_POST_PROCESSING, Rounds, Run

OURS = ("catenary-inline", "catenary-threaded", "catenary-law")
PEERS = ("c", "c-ring", "c-busy", "pysoem")
LAW_AND_STORM = ("catenary-law", "catenary-law-storm")
CPU = "cpu_per_cycle"
COMPARED = (
    "output_delay",
    WAKE_TO_SENT,
    "input_age",
    CPU,
    "receive",
    "process",
    IN_CONTROLLER,
    WITH_POST_PROCESSING,
)


def ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Return the ratios of our figures to those of the peers that ran.

    A ratio is computed in each interleaved round, from the medians of that round (CPU: its mean).
    The result is the median over the rounds, because a slow minute of the machine affects both
    sides.
    """
    by_name = {run.name: run for run in runs}
    found: dict[str, float] = {}
    for ours in OURS:
        for peer in PEERS:
            if ours in by_name and peer in by_name:
                for column in COMPARED:
                    quotient = _ratio(by_name[ours].rounds, by_name[peer].rounds, column)
                    if quotient is not None:
                        found[f"{column}: {ours} / {peer}"] = quotient
    law, storm = (by_name.get(name) for name in LAW_AND_STORM)
    if law and storm:
        quotient = storm.timing_us[IN_CONTROLLER]["p999"] / law.timing_us[IN_CONTROLLER]["p999"]
        found["in_controller p99.9: catenary-law-storm / catenary-law"] = round(quotient, 3)
    return found


def _ratio(ours: Rounds, theirs: Rounds, column: str) -> float | None:
    """Return the median of the rounds' ratios; None if no round has the column on both sides."""
    pairs = zip(_of_rounds(ours, column), _of_rounds(theirs, column), strict=True)
    quotients = [
        mine / max(other, 1e-3) for mine, other in pairs if mine is not None and other is not None
    ]
    return round(median(quotients), 3) if quotients else None


def _of_rounds(rounds: Rounds, column: str) -> Sequence[float | None]:
    return rounds.cpu_us_per_cycle if column == CPU else rounds.timing_us[column]["p50"]
