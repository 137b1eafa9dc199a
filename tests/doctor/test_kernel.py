"""Checks of the kernel."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.doctor.kernel import preemption, preemption_model, throttling, timers
from tests.doctor.machines import STEADY, make

RELEASE = {"/proc/sys/kernel/osrelease": "6.12.1"}


@pytest.mark.parametrize(
    ("files", "model"),
    [
        ({"/sys/kernel/realtime": "1"}, "rt"),
        ({"/proc/version": "Linux version 6.1 #1 SMP PREEMPT_RT Debian"}, "rt"),
        ({"/proc/version": "Linux version 4.4 #1 SMP PREEMPT RT Wed"}, "rt"),
        ({"/sys/kernel/debug/sched/preempt": "none (voluntary) full"}, "voluntary"),
        ({"/proc/cmdline": "quiet preempt=full"}, "full"),
        ({"/boot/config-6.12.1": "CONFIG_PREEMPT_DYNAMIC=y\nCONFIG_PREEMPT_LAZY=y"}, "lazy"),
        ({"/boot/config-6.12.1": "# CONFIG_PREEMPT is not set\nCONFIG_PREEMPT_NONE=y"}, "none"),
        ({"/proc/version": "Linux version 5.10 #1 SMP PREEMPT Thu"}, "full"),
        ({"/proc/version": "Linux version 6.12 #1 SMP PREEMPT_DYNAMIC Thu"}, ""),
        ({}, ""),
    ],
)
def test_the_preemption_model(tmp_path, files, model):
    assert preemption_model(make(tmp_path, {**RELEASE, **files})) == model


@pytest.mark.parametrize(
    ("model", "status"),
    [("full", "WARN"), ("lazy", "WARN"), ("voluntary", "FAIL"), ("none", "FAIL")],
)
def test_a_model_that_real_time_threads_preempt_is_no_failure(tmp_path, model, status):
    files = {"/sys/kernel/debug/sched/preempt": f"none ({model})"}
    assert preemption(make(tmp_path, {**RELEASE, **files})).status == status


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"/etc/os-release": "ID=debian"}, "sudo apt install linux-image-rt-arm64"),
        ({"/etc/os-release": 'ID="ubuntu"'}, "sudo pro enable realtime-kernel"),
        ({"/etc/os-release": "ID=arch"}, "CONFIG_PREEMPT_RT=y"),
        ({"/etc/os-release": "ID=debian", "/.dockerenv": ""}, "on the host"),
    ],
)
def test_the_advice_depends_on_the_distribution(tmp_path, files, words):
    check = preemption(make(tmp_path, files, architecture="aarch64"))
    assert words in check.advice


@pytest.mark.parametrize(
    ("runtime", "status"), [("-1", "PASS"), ("950000", "PASS"), ("500000", "FAIL"), ("0", "FAIL")]
)
def test_throttling_of_real_time_threads(tmp_path, runtime, status):
    files = {
        "/proc/sys/kernel/sched_rt_runtime_us": runtime,
        "/proc/sys/kernel/sched_rt_period_us": "1000000",
    }
    assert throttling(make(tmp_path, files)).status == status


def test_coarse_timers_fail(tmp_path):
    coarse = replace(STEADY, resolution=0.004)
    check = timers(make(tmp_path, {}, clock=coarse))
    assert (check.status, "resolution of 4 ms" in check.found) == ("FAIL", True)
