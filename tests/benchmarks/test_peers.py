"""Every peer, briefly, on a served segment: the form and the order of its figures; no limits."""

from __future__ import annotations

import importlib.util
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.peers import MODULES
from catenary.bench.job import PHASES, Body, Job, Nanoseconds, Round
from catenary.bench.rounds import run_round
from catenary.bench.segment import COUNTS_PER_TURN, RATED_TORQUE, Served, served
from tests.benchmarks.patience import patiently

CYCLES = 50
PERIOD_NS = 2_000_000
BUSY_WAIT = 100e-6  # [s]
NATIVE = ("catenary-threaded", "catenary-law")  # the frames are sent before the body


def present() -> list[str]:
    """Return the peers that this machine can run."""
    lacking = set()
    if shutil.which("cc") is None:
        lacking |= {"c", "c-ring", "c-busy"}
    if importlib.util.find_spec("pysoem") is None:
        lacking |= {"pysoem"}
    return [name for name in MODULES if name not in lacking]


def one_per_module() -> list[str]:
    """Return one peer of each module."""
    return list({MODULES[name]: name for name in present()}.values())


def others() -> list[str]:
    """Return the peers that `one_per_module` leaves out. Each peer runs once."""
    return sorted(set(present()) - set(one_per_module()))


@pytest.mark.usefixtures("veth")  # for its reason to skip
@pytest.mark.parametrize(
    ("body", "names"), [(Body.SINE, others()), (Body.PD, one_per_module())], ids=list(Body)
)
def test_peers_measure_what_they_were_asked(body: Body, names: list[str], tmp_path: Path) -> None:
    with served(2) as segment:
        for name in names:
            job = make_job(name, body, segment)
            found = patiently(partial(run_round, job, tmp_path))
            count, figures = found.samples.shape
            assert 1 <= count <= CYCLES, name  # the log may reach back less far
            assert figures == len(PHASES), name
            assert (phase(found, "receive") >= 0).all(), name
            assert (phase(found, "period") >= 0).all(), name
            assert 0 <= found.lost <= CYCLES, name
            assert found.cpu_per_cycle_ns > 0, name
            assert_figures_are_in_order(name, found)


def assert_figures_are_in_order(name: str, found: Round) -> None:
    """A frame is sent after the wake-up and what precedes it; inputs were sent before the body."""
    wake_to_sent = phase(found, "output_delay") - phase(found, "lateness")
    assert (phase(found, "lateness") >= 0).all(), name
    assert (wake_to_sent > 0).all(), name
    send = phase(found, "send")
    if name.startswith(NATIVE):
        assert (wake_to_sent == send).all(), name
    else:
        before = phase(found, "receive") + phase(found, "process") + send
        assert (wake_to_sent >= before).all(), name
    age = phase(found, "input_age")
    known = age[age >= 0]  # threaded: unknown in a cycle without fresh set-points
    assert len(known) > 0, name
    assert (known > 0).all(), name
    if not name.startswith("catenary-threaded"):
        assert len(known) == len(age), name
    if not name.startswith(NATIVE):  # the frame of the previous cycle
        assert np.median(known) + np.median(wake_to_sent) > PERIOD_NS / 2, name


def phase(found: Round, name: str) -> Nanoseconds:
    return found.samples[:, PHASES.index(name)]


def make_job(peer: str, body: Body, segment: Served) -> Job:
    return Job(
        peer=peer,
        module=MODULES[peer],
        interface=segment.interface,
        drives=segment.drives,
        body=body,
        period_ns=PERIOD_NS,
        warm_up=10,
        cycles=CYCLES,
        cpu=None,
        priority=None,
        counts_per_turn=COUNTS_PER_TURN,
        rated_torque=RATED_TORQUE,
        amplitude=0.1,
        busy_wait=BUSY_WAIT if peer == "c-busy" else 0.0,
    )
