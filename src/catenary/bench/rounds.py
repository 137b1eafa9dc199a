"""Alternating short rounds of all peers (A B C B C A ...), each in a new process.

Disturbances of the machine therefore affect all peers alike, and no peer is always first.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from catenary.bench.job import Job, Round, read_round, write_job
from catenary.errors import CatenaryError
from catenary.realtime.child import start_python

WARM_UP_CYCLES = 200
BRING_UP_SECONDS = 60.0  # maximum time for the bring-up and enabling in a round

MOST_FAILED = 10  # largest number of failed rounds that are repeated

T = TypeVar("T")
Progress = Callable[[str, int, int], None]  # peer, round, rounds


class RoundError(CatenaryError):
    """A peer could not complete its round."""


def run_with_retries(run: Callable[[], T], failed: list[str]) -> T:
    """Run a round, and repeat it if it fails.

    A round fails, for example, if the machine pauses for longer than the devices' watchdog.

    Args:
        run: The round.
        failed: List to which the reasons of failed rounds are added.

    Raises:
        RoundError: Too many rounds have failed.
    """
    while True:
        try:
            return run()
        except RoundError as error:
            if len(failed) >= MOST_FAILED:
                raise
            failed.append(error.message)


def interleave(
    jobs: Sequence[Job], rounds: int, progress: Progress, failed: list[str] | None = None
) -> Mapping[str, list[Round]]:
    """Run all rounds of all jobs.

    Args:
        jobs: One job for each peer.
        rounds: Number of rounds per job.
        progress: Called before each round.
        failed: List to which the reasons of failed rounds are added; these rounds are repeated.
            None raises the error of the first failed round.

    Returns:
        The rounds by name of the peer.
    """
    found: dict[str, list[Round]] = {job.peer: [] for job in jobs}
    with tempfile.TemporaryDirectory(prefix="catenary-bench-") as name:
        for number in range(rounds):
            first = number % max(len(jobs), 1)
            for job in (*jobs[first:], *jobs[:first]):
                progress(job.peer, number + 1, rounds)
                run = partial(run_round, job, Path(name))
                found[job.peer].append(run() if failed is None else run_with_retries(run, failed))
    return found


def run_round(job: Job, folder: Path) -> Round:
    job_path, result_path = folder / "job.json", folder / "result.npz"
    result_path.unlink(missing_ok=True)
    write_job(job, job_path)
    arguments = ["-m", "catenary.bench.worker", str(job_path), str(result_path)]
    seconds = BRING_UP_SECONDS + (job.warm_up + job.cycles) * job.period_ns * 1e-9
    with start_python(arguments) as worker:
        line = worker.read_line(seconds)
    if line != "done":
        reason = line or f"no result within {seconds:.0f} s"
        raise RoundError(f"the peer {job.peer} failed: {reason}")
    return read_round(result_path)
