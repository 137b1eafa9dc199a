"""Checks of the network card."""

from __future__ import annotations

import subprocess
from dataclasses import replace

import pytest

from catenary.doctor.card import Coalescing, Link
from catenary.doctor.network import (
    coalescing,
    driver,
    eee,
    ipv6,
    link,
    managed,
    offloads,
    traffic,
    use,
)
from tests.doctor.machines import I210, I219, controller, laptop, make

PLACE = "/sys/class/net/enp2s0"


@pytest.mark.parametrize(
    ("speed", "full", "status"),
    [
        (100, True, "PASS"),
        (100, False, "FAIL"),
        (10, True, "FAIL"),
        (1000, True, "WARN"),  # no EtherCAT device at the other end
        (-1, None, "SKIP"),
    ],
)
def test_speed(tmp_path, speed, full, status):
    assert link(controller(tmp_path), replace(I210, link=Link(speed, full))).status == status


def test_advice_for_a_port_that_is_down_or_has_no_cable(tmp_path):
    machine = controller(tmp_path)
    assert link(machine, replace(I210, up=False)).advice == "sudo ip link set enp2s0 up"
    assert "cable" in link(machine, replace(I210, running=False)).advice


@pytest.mark.parametrize(
    ("change", "files", "status", "words"),
    [
        ({}, {}, "PASS", "i210"),
        ({"driver": "r8169"}, {}, "WARN", "late frames"),
        ({"driver": "ax88179_178a", "bus": "usb-0000:00:14.0-2"}, {}, "WARN", "on USB"),
        ({"driver": "unheard_of"}, {}, "WARN", "not in the list"),
        ({"driver": "iwlwifi"}, {f"{PLACE}/phy80211/": ""}, "FAIL", "wireless"),
        ({"hardware_type": 772}, {}, "FAIL", "not an Ethernet card"),
        ({"driver": "veth"}, {}, "WARN", "software"),
    ],
)
def test_drivers(tmp_path, change, files, status, words):
    check = driver(controller(tmp_path, **files), replace(I210, **change))
    assert (check.status, words in check.found) == (status, True)


def test_a_card_missing_in_sys_is_not_virtual(tmp_path):
    """/sys was mounted in another network namespace."""
    assert driver(make(tmp_path, {}), I210).status == "PASS"


def test_other_use_of_the_port(tmp_path):
    route = "/proc/net/route"
    assert use(controller(tmp_path / "a"), I210).status == "PASS"
    own = controller(tmp_path / "b", **{route: "Iface\tDest\nenp2s0\t00000000"})
    assert (use(own, I210).status, "default route" in use(own, I210).found) == ("FAIL", True)
    address = controller(tmp_path / "c", **{route: "Iface\tDest\nenp2s0\t0001A8C0"})
    assert use(address, I210).advice == "sudo ip address flush dev enp2s0"
    bridged = controller(tmp_path / "d", **{f"{PLACE}/master/": ""})
    assert use(bridged, I210).status == "WARN"


def test_network_manager(tmp_path):
    check = managed(laptop(tmp_path / "managed"), I219)
    assert "sudo nmcli device set enp0s31f6 managed no" in check.advice
    assert "avahi-daemon" in check.found
    free = {"/run/NetworkManager/devices/2": "[device]\nmanaged=false", "/proc/701/comm": "sh"}
    assert managed(laptop(tmp_path / "free", **free), I219).status == "PASS"


def test_networkd(tmp_path):
    files = {
        "/proc/5/comm": "systemd-network",
        "/run/systemd/netif/links/3": "ADMIN_STATE=configured",
    }
    check = managed(make(tmp_path, files), I210)
    assert check.status == "WARN"
    command, _, reload = check.advice.partition("; ")
    assert reload == "sudo networkctl reload"
    printf, _, target = command.partition(" | sudo tee ")
    assert target == "/etc/systemd/network/10-ethercat.network"
    content = subprocess.run(["sh", "-c", printf], capture_output=True, text=True, check=True)
    assert content.stdout == "[Match]\nName=enp2s0\n\n[Link]\nUnmanaged=yes\n"


def test_frames_of_other_programs(tmp_path):
    machine = controller(tmp_path)
    quiet, loud = (replace(machine, watched=3.0, sent=sent) for sent in (0, 7))
    assert traffic(quiet, I210).found == "no frame was sent in 3 s"
    check = traffic(loud, I210)
    assert (check.status, "sent 7 frames in 3 s" in check.found) == ("WARN", True)


def test_the_kernel_counts_sent_frames(tmp_path):
    """/proc/net/dev has eight columns for reception, then bytes and packets sent."""
    line = "enp2s0:  3193  29  0  0  0  0  0  0  4711  31  0  0  0  0  0  0"
    machine = controller(tmp_path, **{"/proc/net/dev": f"Inter-|\n face |\nenp2s00: 1 1\n{line}"})
    assert machine.frames_sent() == 31
    assert make(tmp_path / "other", {}).frames_sent() is None


def test_configured_ipv6_addresses_are_not_removed(tmp_path):
    assert len(ipv6(laptop(tmp_path / "a"), I219).changes) == 1
    lines = "fd000000000000000000000000000002 02 40 00 82 enp0s31f6"
    check = ipv6(laptop(tmp_path / "b", **{"/proc/net/if_inet6": lines}), I219)
    assert (check.status, check.changes) == ("WARN", ())


def test_eee_that_is_active_or_unsupported(tmp_path):
    machine = laptop(tmp_path)
    assert "active" in eee(machine, I219).found
    assert eee(machine, replace(I219, eee=None, refusals={"eee": "no"})).status == "PASS"


def test_adaptive_coalescing_is_disabled_first(tmp_path):
    """Drivers refuse rx-usecs while adaptive-rx is on."""
    card = replace(I210, coalescing=Coalescing(8, 0, True))
    check = coalescing(controller(tmp_path), card)
    assert check.advice == "sudo ethtool -C enp2s0 adaptive-rx off rx-usecs 0"
    assert [str(change) for change in check.changes] == [
        "ethtool:enp2s0/adaptive-rx = 0",
        "ethtool:enp2s0/rx-usecs = 0",
    ]


def test_offloads_that_delay_frames(tmp_path):
    machine = controller(tmp_path / "a", **{f"{PLACE}/gro_flush_timeout": "20000"})
    check = offloads(machine, I210)
    assert (check.status, "gro_flush_timeout 20000" in check.found) == ("WARN", True)
    assert offloads(controller(tmp_path / "b"), replace(I210, lro=True)).status == "WARN"
