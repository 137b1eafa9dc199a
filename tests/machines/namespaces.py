"""Two private machines: network namespaces with a cable between them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO

from catenary.realtime.private_network import make_veth_pair, run_ip

SLEEP = "import sys; print(flush=True); sys.stdin.read()"


@dataclass(frozen=True)
class Machine:
    """Network namespace of a process, with one network interface."""

    pid: int
    address: str

    def command(self, *arguments: str) -> list[str]:
        """Return the command that runs Python with these arguments in the namespace."""
        return ["nsenter", f"--net=/proc/{self.pid}/ns/net", sys.executable, *arguments]

    def start(self, *arguments: str, output: int | IO[str] | None = None) -> subprocess.Popen[str]:
        """Start Python with these arguments in the namespace."""
        return subprocess.Popen(self.command(*arguments), stdout=output, stderr=output, text=True)


@contextmanager
def two_machines() -> Iterator[tuple[Machine, Machine]]:
    """Yield two machines that are connected by a veth pair. The caller is in a private network."""
    holders = [_hold(), _hold()]
    try:
        machines = [Machine(holder.pid, f"10.77.0.{n}") for n, holder in enumerate(holders, 1)]
        for name, machine in zip(make_veth_pair(), machines, strict=True):
            run_ip("link", "set", name, "netns", str(machine.pid))
            _ip(machine, "link", "set", "lo", "up")
            _ip(machine, "address", "add", f"{machine.address}/24", "dev", name)
            _ip(machine, "link", "set", name, "up")
        yield machines[0], machines[1]
    finally:
        for holder in holders:
            holder.kill()
            holder.wait()


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
