"""Every peer, briefly, on a served segment: the form of what it hands back; nothing timed."""

from __future__ import annotations

import importlib.util
import shutil
from functools import partial
from pathlib import Path

import pytest

from catenary.bench.job import PHASES, Body, Job
from catenary.bench.peers import MODULES
from catenary.bench.rounds import run_round
from catenary.bench.segment import COUNTS_PER_TURN, RATED_TORQUE, Served, served
from tests.bench.patience import patiently

CYCLES = 50
RECEIVE = PHASES.index("receive")


def present() -> list[str]:
    """The peers that this machine can run."""
    lacking = set()
    if shutil.which("cc") is None:
        lacking |= {"c", "c-ring"}
    if importlib.util.find_spec("pysoem") is None:
        lacking |= {"pysoem"}
    return [name for name in MODULES if name not in lacking]


@pytest.mark.usefixtures("veth")  # for its reason to skip
@pytest.mark.parametrize("body", Body)
def test_peers_measure_what_they_were_asked(body: Body, tmp_path: Path) -> None:
    with served(2) as segment:
        for name in present():
            job = make_job(name, body, segment)
            found = patiently(partial(run_round, job, tmp_path))
            count, figures = found.samples.shape
            assert 1 <= count <= CYCLES, name  # a law leaves instants out that have passed
            assert figures == len(PHASES), name
            assert (found.samples[:, RECEIVE] >= 0).all(), name
            assert (found.samples[:, 0] >= 0).all(), name
            assert 0 <= found.lost <= CYCLES, name
            assert found.cpu_ns > 0, name


def make_job(peer: str, body: Body, segment: Served) -> Job:
    return Job(
        peer=peer,
        interface=segment.interface,
        drives=segment.drives,
        body=body,
        period_ns=2_000_000,
        warm_up=10,
        cycles=CYCLES,
        cpu=None,
        priority=None,
        counts_per_turn=COUNTS_PER_TURN,
        rated_torque=RATED_TORQUE,
        amplitude=0.1,
    )
