"""A network namespace of our own: real frames over veth pairs, without hardware or harm.

    state = private_network.enter()         # runs this program again, inside
    if isinstance(state, Refused):
        print(f"no real frames: {state.reason}")

Call `enter` first thing in `main`, before anything is started or opened. From a shell:
`python -m catenary.realtime.private_network -m pytest`.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "CATENARY_PRIVATE_NETWORK"  # in the environment of a program run by `enter`
INSIDE = "inside"
MODULE = "catenary.realtime.private_network"
PROBE_SECONDS = 30.0  # a refusal is prompt, a busy machine is not
ETHERTYPE = 0x88A4
CARRIER_SECONDS, LOOK_SECONDS = 2.0, 0.001  # at most; between two looks
STATE_UP = " state UP "


@dataclass(frozen=True, slots=True)
class Private:
    """This process is alone in its network namespace."""


@dataclass(frozen=True, slots=True)
class Refused:
    """The machine gives no namespace in which real frames work."""

    reason: str


def state() -> Private | Refused:
    """Where this process is, without changing it."""
    value = os.environ.get(VARIABLE, "")
    if value == INSIDE:
        return Private()
    return Refused(value or "not started in a private network namespace")


def enter(command: Sequence[str] | None = None) -> Private | Refused:
    """Replaces this process by `command` (default: this program again) in a namespace of its own.

    Returns only where that has happened already, or is refused.
    """
    if VARIABLE in os.environ:
        return state()
    way = find_way()
    if isinstance(way, Refused):
        os.environ[VARIABLE] = way.reason  # asked once, for our children too
        return way
    command = command or [sys.executable, *sys.orig_argv[1:]]
    sys.stdout.flush()
    sys.stderr.flush()
    os.execvpe(way[0], [*way, *inside_command(command)], {**os.environ, VARIABLE: INSIDE})


def find_way() -> list[str] | Refused:
    """The `unshare` command that gives a working namespace, found by trying."""
    if sys.platform != "linux":
        return Refused("private network namespaces are Linux's")
    for tool, package in (("unshare", "util-linux"), ("ip", "iproute2")):
        if shutil.which(tool) is None:
            return Refused(f"`{tool}` is not installed (package {package})")
    as_user = ["unshare", "--user", "--map-root-user", "--net"]
    ways = [["unshare", "--net"], as_user] if os.geteuid() == 0 else [as_user]
    reasons = []
    for way in ways:
        reason = probe(way)
        if not reason:
            return way
        reasons.append(f"`{' '.join(way)}`: {reason}")
    return Refused("; ".join(reasons))


def probe(way: Sequence[str]) -> str:
    """Why real frames do not work there; empty: they do.

    Ubuntu 24.04's AppArmor lets `unshare` pass and refuses what comes after, so all of it is tried.
    """
    command = [*way, *inside_command([sys.executable, "-m", MODULE, "--probe"])]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PROBE_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return "" if done.returncode == 0 else (done.stderr.strip() or "refused").splitlines()[-1]


def inside_command(command: Sequence[str]) -> list[str]:
    """`command`, preceded by what a fresh namespace lacks."""
    return ["sh", "-c", 'ip link set lo up; exec "$0" "$@"', *command]


def try_real_frames() -> None:
    """Sends one frame over a veth pair of our own; OSError: refused."""
    frame = b"\xff" * 6 + bytes(6) + ETHERTYPE.to_bytes(2, "big") + bytes(46)
    with (
        veth_pair() as (first, second),
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sender,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as receiver,
    ):
        sender.bind((first, ETHERTYPE))
        receiver.bind((second, ETHERTYPE))
        receiver.settimeout(20.0)
        sender.send(frame)
        receiver.recv(2048)


@contextlib.contextmanager
def veth_pair() -> Iterator[tuple[str, str]]:
    """Two names of connected interfaces, up and silent (no IPv6); removed at the end."""
    first, second = make_veth_pair()
    try:
        yield first, second
    finally:
        run_ip("link", "delete", first)


def make_veth_pair() -> tuple[str, str]:
    """As `veth_pair`, for as long as the namespace lives. What is sent on either is taken."""
    taken = {name for _, name in socket.if_nameindex()}
    number = next(n for n in range(len(taken) + 1) if f"cat{n}a" not in taken)
    names = f"cat{number}a", f"cat{number}b"
    run_ip("link", "add", "name", names[0], "type", "veth", "peer", "name", names[1])
    for name in names:
        silence(name)
        run_ip("link", "set", name, "up")
    for name in names:
        await_carrier(name)
    return names


def await_carrier(name: str) -> None:
    """The kernel notices beside us that both ends are up; until then it drops what is sent on the
    first, without a word. Where it does not say so in time, it may do without."""
    until = time.monotonic() + CARRIER_SECONDS
    while STATE_UP not in run_ip("-o", "link", "show", name) and time.monotonic() < until:
        time.sleep(LOOK_SECONDS)


def silence(name: str) -> None:
    """Turns IPv6 off: a real EtherCAT cable carries no router solicitations."""
    with contextlib.suppress(OSError):  # no IPv6 in this kernel, or /proc/sys is read-only
        Path("/proc/sys/net/ipv6/conf", name, "disable_ipv6").write_text("1")


def run_ip(*arguments: str) -> str:
    """What it prints. OSError: it failed, in its words."""
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def main(arguments: Sequence[str]) -> None:
    """Runs Python with `arguments` inside, or says why not and runs it here."""
    if list(arguments) == ["--probe"]:
        try:
            try_real_frames()
        except OSError as error:
            sys.exit(str(error))
        return
    refused = enter([sys.executable, *arguments])
    if isinstance(refused, Refused):
        print(f"No private network: {refused.reason}", file=sys.stderr)
    os.execv(sys.executable, [sys.executable, *arguments])


if __name__ == "__main__":
    main(sys.argv[1:])
