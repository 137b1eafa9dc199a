"""Private networks: programs run inside, or get the reason for a refusal."""

from __future__ import annotations

import os
import socket
import subprocess
import sys

import pytest

from catenary.realtime import private_network
from catenary.realtime.private_network import INSIDE, VARIABLE, Private, Refused

REPORT = """
import socket
from catenary.realtime import private_network
print(private_network.enter())
print(*(name for _, name in socket.if_nameindex()))
"""


def run_python(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    surroundings = {name: value for name, value in os.environ.items() if name != VARIABLE}
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=surroundings | environment,
    )


def test_the_import_does_not_import_numpy():
    modules = "private_network, child"
    code = (
        f"import sys; from catenary.realtime import {modules}; "
        "from catenary.realtime.system import scheduling; print('numpy' in sys.modules)"
    )
    assert run_python("-c", code).stdout == "False\n"


def test_a_program_enters_a_network_without_other_interfaces(veth):
    done = run_python("-c", REPORT)
    assert done.stdout == "Private()\nlo\n", done.stderr


def test_a_child_program_stays_in_the_network(veth):
    done = run_python("-c", REPORT, **{VARIABLE: INSIDE})
    assert done.stdout.splitlines()[0] == "Private()"
    assert veth[0] in done.stdout


def test_run_a_module_inside_from_the_shell(veth):
    done = run_python("-m", private_network.MODULE, "-c", REPORT)
    assert done.stdout == "Private()\nlo\n", done.stderr


def test_a_refused_program_continues_and_has_the_reason(tmp_path):
    done = run_python("-c", REPORT, PATH=str(tmp_path))
    assert done.stdout.startswith("Refused(reason='`unshare` is not installed"), done.stderr


def test_a_refusal_after_unshare_is_detected(tmp_path):
    unshare = tmp_path / "unshare"
    unshare.write_text('#!/bin/sh\nwhile [ "${1#--}" != "$1" ]; do shift; done\nexec "$@"\n')
    ip = tmp_path / "ip"
    ip.write_text("#!/bin/sh\necho 'RTNETLINK answers: Operation not permitted' >&2\nexit 2\n")
    unshare.chmod(0o755)
    ip.chmod(0o755)
    done = run_python("-c", REPORT, PATH=f"{tmp_path}:/usr/bin:/bin")
    assert "Refused(" in done.stdout
    assert "Operation not permitted" in done.stdout


def test_children_of_a_refused_program_do_not_probe_again(monkeypatch):
    monkeypatch.setenv(VARIABLE, "no such luck")
    assert private_network.enter() == Refused("no such luck")


def test_state_by_the_environment(monkeypatch):
    monkeypatch.setenv(VARIABLE, INSIDE)
    assert private_network.state() == Private()
    monkeypatch.delenv(VARIABLE)
    assert private_network.state() == Refused("not started in a private network namespace")


def test_pairs_have_no_ipv6_and_are_removed(veth):
    names = {name for _, name in socket.if_nameindex()}
    assert set(veth) <= names
    shown = subprocess.run(["ip", "-6", "address"], capture_output=True, text=True, check=True)
    assert veth[0] not in shown.stdout
    with private_network.veth_pair() as others:
        assert not set(others) & names
    assert {name for _, name in socket.if_nameindex()} == names


@pytest.mark.parametrize(("late", "looks"), [(0, 1), (3, 4), (10**9, 2000)])
def test_a_pair_is_ready_when_both_ends_are_up(monkeypatch, late, looks):
    """The kernel drops frames until then, so that a probe with one frame would fail."""
    asked, now = [], 0.0

    def run_ip(*arguments):
        asked.append(arguments)
        return (
            f"7: cat0a@cat0b: mtu 1500 state {'UP' if len(asked) > late else 'LOWERLAYERDOWN'} mode"
        )

    def sleep(seconds):
        nonlocal now
        now += seconds

    monkeypatch.setattr(private_network, "run_ip", run_ip)
    monkeypatch.setattr(private_network.time, "sleep", sleep)
    monkeypatch.setattr(private_network.time, "monotonic", lambda: now)
    private_network.await_carrier("cat0a")
    assert asked[-1] == ("-o", "link", "show", "cat0a")
    assert len(asked) == pytest.approx(looks, rel=0.01)


def test_the_first_frame_of_a_pair_arrives(veth):
    frame = b"\xff" * 6 + bytes(6) + b"\x88\xa4" + bytes(46)
    for _ in range(20):
        with (
            private_network.veth_pair() as (first, second),
            socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sender,
            socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as receiver,
        ):
            sender.bind((first, private_network.ETHERTYPE))
            receiver.bind((second, private_network.ETHERTYPE))
            receiver.settimeout(20.0)
            sender.send(frame)
            assert receiver.recv(2048) == frame


def test_an_error_of_ip_is_raised_with_its_message():
    with pytest.raises(OSError, match=r"ip link delete none0: .*none0"):
        private_network.run_ip("link", "delete", "none0")
