"""Private machines: network namespaces that are connected by a switch."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO

from catenary.realtime.private_network import make_veth_pair, run_ip

SWITCH = "switch"
SLEEP = "import sys; print(flush=True); sys.stdin.read()"


@dataclass(frozen=True)
class Machine:
    """Network namespace of a process, with one network interface."""

    pid: int
    address: str

    def command(self, *arguments: str, python: str = sys.executable) -> list[str]:
        """Return the command that runs Python with these arguments in the namespace."""
        return ["nsenter", f"--net=/proc/{self.pid}/ns/net", python, *arguments]

    def start(self, *arguments: str, output: int | IO[str] | None = None) -> subprocess.Popen[str]:
        """Start Python with these arguments in the namespace."""
        return subprocess.Popen(self.command(*arguments), stdout=output, stderr=output, text=True)


@contextmanager
def connected_machines(count: int) -> Iterator[list[Machine]]:
    """Yield machines that are connected by a switch. The caller is in a private network."""
    holders: list[subprocess.Popen[str]] = []
    run_ip("link", "add", SWITCH, "type", "bridge", "mcast_snooping", "0")
    try:
        run_ip("link", "set", SWITCH, "up")
        for number in range(1, count + 1):
            holders.append(_hold())
            _connect(Machine(holders[-1].pid, f"10.77.0.{number}"))
        yield [Machine(each.pid, f"10.77.0.{n}") for n, each in enumerate(holders, 1)]
    finally:
        for holder in holders:
            holder.kill()
            holder.wait()
        run_ip("link", "delete", SWITCH)


def _connect(machine: Machine) -> None:
    """Connect a machine to the switch."""
    port, name = make_veth_pair()
    run_ip("link", "set", port, "master", SWITCH)
    run_ip("link", "set", name, "netns", str(machine.pid))
    _ip(machine, "link", "set", "lo", "up")
    _ip(machine, "address", "add", f"{machine.address}/24", "dev", name)
    _ip(machine, "link", "set", name, "up")


def _hold() -> subprocess.Popen[str]:
    """Start a process that holds a new network namespace until it is killed."""
    holder = subprocess.Popen(
        ["unshare", "--net", sys.executable, "-c", SLEEP],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "\n"
    return holder


def _ip(machine: Machine, *arguments: str) -> None:
    command: Sequence[str] = ["nsenter", f"--net=/proc/{machine.pid}/ns/net", "ip", *arguments]
    subprocess.run(command, check=True)
