"""All verdicts on four simulated machines."""

from __future__ import annotations

import pytest

from catenary.doctor import this_machine
from catenary.doctor.check import failed, warned
from catenary.doctor.examination import Examination, examine
from catenary.errors import LinkError
from tests.doctor import machines

VERDICTS = {
    # id: controller, laptop, container, guest
    "kernel-preemption": "PASS FAIL PASS WARN",
    "kernel-rt-throttling": "PASS PASS PASS PASS",
    "kernel-timers": "PASS PASS PASS PASS",
    "virtual-machine": "PASS PASS PASS WARN",
    "cpu-isolated": "PASS WARN PASS WARN",
    "cpu-nohz-full": "PASS WARN PASS SKIP",
    "cpu-smt": "PASS WARN PASS SKIP",
    "cpu-governor": "PASS WARN PASS SKIP",
    "cpu-idle-states": "PASS WARN PASS SKIP",
    "clock-source": "PASS PASS PASS FAIL",
    "clock-slewing": "PASS WARN PASS PASS",
    "clock-daemons": "PASS PASS PASS SKIP",
    "limit-memlock": "PASS FAIL FAIL PASS",
    "limit-rtprio": "PASS FAIL FAIL PASS",
    "permission-raw-socket": "PASS FAIL PASS PASS",
    "memory-huge-pages": "PASS WARN PASS SKIP",
    "container": "PASS PASS FAIL PASS",
    "share-folder": "PASS PASS PASS PASS",
    "nic-driver": "PASS WARN WARN WARN",
    "nic-link": "PASS WARN PASS SKIP",
    "nic-use": "PASS WARN PASS FAIL",
    "nic-managed": "PASS WARN PASS PASS",
    "nic-traffic": "SKIP SKIP SKIP SKIP",
    "nic-ipv6": "PASS WARN PASS PASS",
    "nic-eee": "PASS WARN PASS PASS",
    "nic-coalescing": "PASS WARN SKIP SKIP",
    "nic-offloads": "PASS PASS PASS PASS",
    "nic-interrupts": "PASS WARN SKIP PASS",
    "spin": "PASS WARN WARN WARN",
    "latency": "SKIP SKIP SKIP SKIP",
}
MACHINES = (machines.controller, machines.laptop, machines.container, machines.guest)


@pytest.mark.parametrize("column", range(4), ids=[make.__name__ for make in MACHINES])
def test_the_verdicts(tmp_path, column):
    checks = examine(MACHINES[column](tmp_path)).checks
    found = {check.id: check.status for check in checks}
    assert found == {id: words.split()[column] for id, words in VERDICTS.items()}
    for check in checks:
        assert check.found
        assert check.advice or check.status in ("PASS", "SKIP"), check


def test_an_unknown_machine_passes_few_checks(tmp_path):
    checks = examine(machines.make(tmp_path, {}, clock=None)).checks
    statuses = {check.id: check.status for check in checks}
    assert statuses["limit-rtprio"] == "SKIP"
    assert statuses["permission-raw-socket"] == "FAIL"
    assert [id for id, status in statuses.items() if status == "PASS"] == [
        "virtual-machine",
        "container",
    ]
    assert "this kernel has no /proc/self/limits" in {check.found for check in checks}


def test_reversible_changes_of_a_laptop(tmp_path):
    targets = [change.target for change in examine(machines.laptop(tmp_path)).changes]
    assert targets == [
        *(f"{machines.CPU}/cpu{n}/cpufreq/scaling_governor" for n in range(4)),
        *(f"{machines.CPU}/cpu{n}/cpuidle/state3/disable" for n in range(4)),
        "/sys/kernel/mm/transparent_hugepage/enabled",
        "/proc/sys/net/ipv6/conf/enp0s31f6/disable_ipv6",
        "ethtool:enp0s31f6/eee",
        "ethtool:enp0s31f6/rx-usecs",
    ]
    assert examine(machines.controller(tmp_path / "controller")).changes == ()


def test_no_changes_of_a_port_with_the_default_route():
    change = machines.Machine  # any value; only the check that it belongs to matters
    coalescing = warned("nic-coalescing", "", "", (change,))
    in_use = failed("nic-use", "", "")
    assert Examination((("", (coalescing,)),)).changes == (change,)
    assert Examination((("", (coalescing, in_use)),)).changes == ()


def test_without_a_card_the_report_lists_the_cards(tmp_path):
    machine = machines.make(tmp_path, machines.LAPTOP)
    [check] = [check for check in examine(machine).checks if check.id == "nic"]
    assert check.status == "SKIP"
    assert "this machine has enp0s31f6, wlp3s0" in check.found


def test_a_card_that_does_not_exist():
    with pytest.raises(LinkError, match="there is no network interface 'nope'") as error:
        this_machine("nope")
    assert "lo" in error.value.hint


def test_a_cpu_that_does_not_exist():
    with pytest.raises(ValueError, match="CPU 5000 does not exist"):
        this_machine(None, cpu=5000)


def test_examine_this_machine():
    checks = examine(this_machine("lo")).checks
    statuses = {check.id: check.status for check in checks}
    assert statuses["nic-driver"] == "FAIL"  # lo is not an Ethernet card
    assert statuses["latency"] == "SKIP"
    assert len(statuses) == len(VERDICTS)
