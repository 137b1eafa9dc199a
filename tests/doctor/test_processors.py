"""Checks of the processors: each names the right CPU."""

from __future__ import annotations

from catenary.doctor.processors import governor, idle_states, isolated, nohz_full, smt
from tests.doctor.machines import CPU, controller, each_cpu, laptop, make


def test_the_boot_options_isolate_the_last_cpu(tmp_path):
    check = isolated(laptop(tmp_path))
    assert check.advice.startswith("add `isolcpus=3 rcu_nocbs=3 irqaffinity=0-2` to GRUB_CMDLINE")


def test_a_loop_on_another_cpu_than_the_isolated_one(tmp_path):
    machine = make(tmp_path, {f"{CPU}/online": "0-3", f"{CPU}/isolated": "2-3"}, wanted_cpu=1)
    check = isolated(machine)
    assert (check.status, check.advice) == ("WARN", "run it on CPU 3: taskset -c 3")


def test_a_single_cpu_cannot_be_isolated(tmp_path):
    check = isolated(make(tmp_path, {f"{CPU}/online": "0"}))
    assert (check.status, check.advice) == ("WARN", "use a machine with two or more CPUs")


def test_the_tick_must_stop_on_the_loops_cpu(tmp_path):
    files = {f"{CPU}/online": "0-3", f"{CPU}/nohz_full": "1-2"}
    assert nohz_full(make(tmp_path, files, wanted_cpu=2)).status == "PASS"
    check = nohz_full(make(tmp_path, files, wanted_cpu=3))
    assert (check.status, "nohz_full=3" in check.advice) == ("WARN", True)


def test_a_shared_core_passes_once_the_sibling_is_offline(tmp_path):
    assert "CPU 3 shares its core with CPU 1" in smt(laptop(tmp_path)).found
    machine = laptop(tmp_path / "off", **{f"{CPU}/online": "0,2-3"})
    assert smt(machine).status == "PASS"


def test_only_slow_cpus_are_changed(tmp_path):
    files = {
        **each_cpu("cpufreq/scaling_governor", "performance"),
        f"{CPU}/cpu2/cpufreq/scaling_governor": "schedutil",
    }
    check = governor(make(tmp_path, files))
    assert check.found.startswith("schedutil on 1 of 4 CPUs")
    assert [change.target for change in check.changes] == [f"{CPU}/cpu2/cpufreq/scaling_governor"]


def test_a_disabled_idle_state_does_not_count(tmp_path):
    assert idle_states(controller(tmp_path)).status == "PASS"
    machine = controller(tmp_path / "on", **{f"{CPU}/cpu3/cpuidle/state1/disable": "0"})
    check = idle_states(machine)
    assert (check.status, "takes 170 us" in check.found) == ("WARN", True)


def test_idle_poll_passes(tmp_path):
    machine = laptop(tmp_path, **{"/proc/cmdline": "quiet idle=poll"})
    assert idle_states(machine).status == "PASS"
