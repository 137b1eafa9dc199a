"""The interfaces of a machine, compared with what `ip` shows."""

from __future__ import annotations

import json
import subprocess

import catenary as cat


def test_a_pair_of_interfaces(veth: tuple[str, str]) -> None:
    shown = json.loads(subprocess.run(["ip", "-j", "link"], capture_output=True, check=True).stdout)
    ether = {each["ifname"]: each for each in shown if each["link_type"] == "ether"}
    found = {each.name: each for each in cat.interfaces()}
    assert set(veth) <= set(found) == set(ether)
    for name, interface in found.items():
        assert interface.mac == ether[name]["address"]
        assert interface.is_up == ("UP" in ether[name]["flags"])
        assert interface.has_link == ("LOWER_UP" in ether[name]["flags"])


def test_an_interface_that_is_down_has_no_link(veth: tuple[str, str]) -> None:
    ours, theirs = veth
    subprocess.run(["ip", "link", "set", theirs, "down"], check=True)
    found = {each.name: each for each in cat.interfaces()}
    assert not found[theirs].is_up
    assert found[ours].is_up
    assert not found[ours].has_link
    assert not found[theirs].has_link


def test_loopback_is_not_among_them() -> None:
    assert "lo" not in {each.name for each in cat.interfaces()}
