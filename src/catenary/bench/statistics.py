"""Statistics of rounds: mean, min, max, sd, p50, p99, p99.9 [us] of each phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.bench.job import PHASES, Round

Values = npt.NDArray[np.float64]
Timing = dict[str, dict[str, float]]

IN_CONTROLLER, WITH_POST_PROCESSING, WAKE_TO_SENT = (
    "in_controller",
    "in_controller+post_processing",
    "wake_to_sent",
)
DERIVED = (IN_CONTROLLER, WITH_POST_PROCESSING, WAKE_TO_SENT)
"""Columns computed from the phases of every cycle.

in_controller = receive + process + send; in_controller+post_processing = the sum of these two;
wake_to_sent = output_delay - lateness (wake-up → last cyclic frame passed to the kernel).
"""
PER_ROUND = ("p50", "p99", "max")  # figures stored for each round


@dataclass(frozen=True, slots=True)
class Rounds:
    """Figures of each round, in the order of the rounds."""

    cycles: list[int]
    lost: list[int]
    uncommitted: list[int]
    cpu_us_per_cycle: list[float]
    timing_us: dict[str, dict[str, list[float | None]]]  # None if the phase did not occur


@dataclass(frozen=True, slots=True)
class Run:
    """Figures of one peer over all of its rounds."""

    name: str
    cycles: int
    lost: int
    uncommitted: int
    cpu_us_per_cycle: float
    scheduling: str
    timing_us: Timing
    rounds: Rounds
    answers: int = 0  # number of answers to SDO requests


def combine(name: str, rounds: Sequence[Round]) -> Run:
    """Return the figures of a peer over all cycles and for each round."""
    each = [columns_of(one) for one in rounds]
    together = {column: np.concatenate([one[column] for one in each]) for column in each[0]}
    counts = [len(one.samples) for one in rounds]
    cpu_ns = sum(one.cpu_per_cycle_ns * count for one, count in zip(rounds, counts, strict=True))
    return Run(
        name=name,
        cycles=sum(counts),
        lost=sum(one.lost for one in rounds),
        uncommitted=sum(one.uncommitted for one in rounds),
        cpu_us_per_cycle=cpu_ns * 1e-3 / sum(counts),
        scheduling=" / ".join(sorted({one.scheduling for one in rounds})),
        timing_us={column: summarise(values) for column, values in together.items()},
        rounds=Rounds(
            cycles=counts,
            lost=[one.lost for one in rounds],
            uncommitted=[one.uncommitted for one in rounds],
            cpu_us_per_cycle=[round(one.cpu_per_cycle_ns * 1e-3, 3) for one in rounds],
            timing_us={column: _per_round([one[column] for one in each]) for column in together},
        ),
        answers=sum(one.answers for one in rounds),
    )


def columns_of(one: Round) -> dict[str, Values]:
    """Return the phases and the derived columns of a round [us], without missing values."""
    samples = np.where(one.samples < 0, np.nan, one.samples * 1e-3)
    columns = dict(zip(PHASES, samples.T, strict=True))
    columns[IN_CONTROLLER] = columns["receive"] + columns["process"] + columns["send"]
    columns[WITH_POST_PROCESSING] = columns[IN_CONTROLLER] + columns["post_processing"]
    columns[WAKE_TO_SENT] = columns["output_delay"] - columns["lateness"]
    columns["period"] = columns["period"][1:]  # the first period started before the round
    return {name: values[~np.isnan(values)] for name, values in columns.items()}


def _per_round(rounds: Sequence[Values]) -> dict[str, list[float | None]]:
    found = [summarise(values) if len(values) else None for values in rounds]
    return {figure: [one[figure] if one else None for one in found] for figure in PER_ROUND}


def summarise(values: Values) -> dict[str, float]:
    """Return the figures of one or more values."""
    p50, p99, p999 = np.percentile(values, [50.0, 99.0, 99.9])
    figures = {
        "mean": values.mean(),
        "min": values.min(),
        "max": values.max(),
        "sd": values.std(),
        "p50": p50,
        "p99": p99,
        "p999": p999,
    }
    return {name: round(float(figure), 3) for name, figure in figures.items()}
