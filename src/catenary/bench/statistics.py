"""From samples of phases to the figures of a table: mean, min, max, sd, p50, p99, p99.9 [us]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.bench.job import PHASES, Round

Timing = dict[str, dict[str, float]]


@dataclass(frozen=True, slots=True)
class Run:
    """All rounds of one peer together."""

    name: str
    cycles: int
    lost: int
    late: int
    cpu_us_per_cycle: float
    scheduling: str
    timing_us: Timing
    answers: int = 0  # to SDOs


def combine(name: str, rounds: Sequence[Round]) -> Run:
    measured = np.concatenate([one.samples for one in rounds])
    samples = np.where(measured < 0, np.nan, measured * 1e-3)
    columns = dict(zip(PHASES, samples.T, strict=True))
    columns["in_controller"] = columns["receive"] + columns["process"] + columns["send"]
    # The first period of a round began in another process' time.
    columns["period"] = np.concatenate([one.samples[1:, 0] for one in rounds]) * 1e-3
    return Run(
        name=name,
        cycles=len(samples),
        lost=sum(one.lost for one in rounds),
        late=sum(one.late for one in rounds),
        cpu_us_per_cycle=sum(one.cpu_ns for one in rounds) * 1e-3 / len(samples),
        scheduling=" / ".join(sorted({one.scheduling for one in rounds})),
        timing_us={phase: summarise(v[~np.isnan(v)]) for phase, v in columns.items()},
        answers=sum(one.answers for one in rounds),
    )


def summarise(values: npt.NDArray[np.float64]) -> dict[str, float]:
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


LAW_AND_STORM = ("catenary-law", "catenary-law-storm")


def ratios(runs: Sequence[Run]) -> dict[str, float]:
    """Catenary's medians over its peers', as far as the peers ran."""
    median = {run.name: _medians(run) for run in runs}
    found: dict[str, float] = {}
    for ours in ("catenary-inline", "catenary-threaded", "catenary-law"):
        for peer in ("c", "c-ring", "pysoem"):
            if ours in median and peer in median:
                for phase in ("receive", "process", "in_controller", "in_controller+tail"):
                    quotient = median[ours][phase] / max(median[peer][phase], 1e-3)
                    found[f"{phase}: {ours} / {peer}"] = round(quotient, 3)
    law, storm = (next((r for r in runs if r.name == name), None) for name in LAW_AND_STORM)
    if law and storm:
        quotient = storm.timing_us["in_controller"]["p999"] / law.timing_us["in_controller"]["p999"]
        found["in_controller p99.9: catenary-law-storm / catenary-law"] = round(quotient, 3)
    return found


def _medians(run: Run) -> Mapping[str, float]:
    medians = {phase: figures["p50"] for phase, figures in run.timing_us.items()}
    medians["in_controller+tail"] = medians["in_controller"] + medians["tail"]
    return medians
