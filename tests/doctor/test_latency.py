"""Wake-up latency: verdicts on given figures, and a measurement without limits."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest

from catenary.doctor.latency import Latency, judge, measure, obtainable_cpu
from catenary.realtime.statistics import Figure
from tests.doctor.machines import GUEST, make


def latency(worst: float, period: float = 1e-3) -> Latency:
    figure = Figure(3000, 5e-6, 2e-6, worst, 1e-6, 4e-6, 9e-6, 20e-6)
    return Latency(
        3.0, period, 3, figure, 0, "SCHED_FIFO 80", ((2e-6, 4e-6, 2999), (worst, worst, 1))
    )


@pytest.mark.parametrize(
    ("worst", "period", "status"),
    [
        (99e-6, 1e-3, "PASS"),
        (101e-6, 1e-3, "WARN"),
        (499e-6, 1e-3, "WARN"),
        (501e-6, 1e-3, "FAIL"),
        (99e-6, 125e-6, "FAIL"),  # good at 1 kHz, bad at 8 kHz
    ],
)
def test_the_verdict_depends_on_the_period(tmp_path, worst, period, status):
    assert judge(latency(worst, period), make(tmp_path, {})).status == status


def test_the_advice_for_a_virtual_machine(tmp_path):
    check = judge(latency(0.5), make(tmp_path, GUEST))
    assert check.advice.startswith("the host can delay a virtual machine")


def test_the_advice_without_real_time_priority(tmp_path):
    refused = replace(latency(0.5), scheduling="SCHED_OTHER, SCHED_FIFO 80 refused")
    check = judge(refused, make(tmp_path, GUEST))
    assert check.advice.startswith("fix the permissions first (limit-rtprio")


def test_no_measurement_is_skipped(tmp_path):
    machine = make(tmp_path, {})
    assert judge(None, machine).status == "SKIP"
    none = replace(latency(0.0), lateness=Figure(0, 0, 0, 0, 0, 0, 0, 0))
    assert judge(none, machine).status == "SKIP"


def test_measure_on_this_machine():
    cpu = max(os.sched_getaffinity(0))
    measured = measure(0.2, period=1e-3, priority=80, cpu=cpu)
    figure = measured.lateness
    assert figure.count > 0
    assert 0 <= figure.min <= figure.p50 <= figure.max
    assert sum(count for _, _, count in measured.histogram) == figure.count
    assert f"CPU {cpu}" in measured.scheduling


def test_a_cpu_outside_of_the_default_set_is_obtainable(tmp_path):
    """With isolcpus, such a CPU is not in the default set."""
    ours = os.sched_getaffinity(0)
    if len(ours) < 2:
        pytest.skip("one CPU")
    os.sched_setaffinity(0, {min(ours)})
    try:
        assert obtainable_cpu(make(tmp_path, {}, wanted_cpu=max(ours))) == max(ours)
        assert obtainable_cpu(make(tmp_path, {}, wanted_cpu=4000)) is None
        measured = measure(0.05, period=1e-3, priority=80, cpu=max(ours))
        assert f"CPU {max(ours)}" in measured.scheduling
        assert os.sched_getaffinity(0) == {min(ours)}
    finally:
        os.sched_setaffinity(0, ours)
