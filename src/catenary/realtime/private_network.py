"""Private network namespace: real frames over veth pairs, without hardware or side effects.

    state = private_network.enter()         # restarts this program inside
    if isinstance(state, Refused):
        print(f"no real frames: {state.reason}")

Call `enter` at the start of `main`, before the program starts threads or opens files. From a shell:
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

VARIABLE = "CATENARY_PRIVATE_NETWORK"  # environment variable that `enter` sets for the program
INSIDE = "inside"
MODULE = "catenary.realtime.private_network"
PROBE_SECONDS = 30.0  # generous, because a busy machine is slow
ETHERTYPE = 0x88A4
CARRIER_SECONDS, CHECK_SECONDS = 2.0, 0.001  # timeout, and interval of the checks
STATE_UP = " state UP "


@dataclass(frozen=True, slots=True)
class Private:
    """State of a process that runs in its own network namespace."""


@dataclass(frozen=True, slots=True)
class Refused:
    """State of a process that has no private network; `reason` is the cause."""

    reason: str


def state() -> Private | Refused:
    """Return `Private` in a private network, otherwise `Refused` with the reason."""
    value = os.environ.get(VARIABLE, "")
    if value == INSIDE:
        return Private()
    return Refused(value or "not started in a private network namespace")


def enter(command: Sequence[str] | None = None) -> Private | Refused:
    """Replace this process by `command` in a new namespace; the default restarts this program.

    Return only if this process is already inside, or if the namespace is refused. A refusal is
    stored in the environment, so that child processes do not probe again.
    """
    if VARIABLE in os.environ:
        return state()
    unshare = find_namespace()
    if isinstance(unshare, Refused):
        os.environ[VARIABLE] = unshare.reason  # children inherit the result and do not probe again
        return unshare
    command = command or [sys.executable, *sys.orig_argv[1:]]
    sys.stdout.flush()
    sys.stderr.flush()
    os.execvpe(unshare[0], [*unshare, *inside_command(command)], {**os.environ, VARIABLE: INSIDE})


def find_namespace() -> list[str] | Refused:
    """Probe for an `unshare` command that creates a working namespace, and return it.

    Return `Refused` with the reasons if there is none.
    """
    if sys.platform != "linux":
        return Refused("private network namespaces exist only on Linux")
    for tool, package in (("unshare", "util-linux"), ("ip", "iproute2")):
        if shutil.which(tool) is None:
            return Refused(f"`{tool}` is not installed (package {package})")
    as_user = ["unshare", "--user", "--map-root-user", "--net"]
    candidates = [["unshare", "--net"], as_user] if os.geteuid() == 0 else [as_user]
    reasons = []
    for unshare in candidates:
        reason = probe(unshare)
        if not reason:
            return unshare
        reasons.append(f"`{' '.join(unshare)}`: {reason}")
    return Refused("; ".join(reasons))


def probe(unshare: Sequence[str]) -> str:
    """Return the reason why real frames fail in such a namespace; "" if they work.

    Probe all steps, because AppArmor on Ubuntu 24.04 permits `unshare` but refuses later steps.
    """
    command = [*unshare, *inside_command([sys.executable, "-m", MODULE, "--probe"])]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PROBE_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return "" if done.returncode == 0 else (done.stderr.strip() or "refused").splitlines()[-1]


def inside_command(command: Sequence[str]) -> list[str]:
    """Return `command`, preceded by the setup of a new namespace."""
    return ["sh", "-c", 'ip link set lo up; exec "$0" "$@"', *command]


def try_real_frames() -> None:
    """Send one frame over a new veth pair. Raises OSError if this fails."""
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
    """Create two connected interfaces without IPv6, yield their names, and remove them."""
    first, second = make_veth_pair()
    try:
        yield first, second
    finally:
        run_ip("link", "delete", first)


def make_veth_pair() -> tuple[str, str]:
    """Create a veth pair that exists until the namespace ends, and return the two names."""
    taken = {name for _, name in socket.if_nameindex()}
    number = next(n for n in range(len(taken) + 1) if f"cat{n}a" not in taken)
    names = f"cat{number}a", f"cat{number}b"
    run_ip("link", "add", "name", names[0], "type", "veth", "peer", "name", names[1])
    for name in names:
        disable_ipv6(name)
        run_ip("link", "set", name, "up")
    for name in names:
        await_carrier(name)
    return names


def await_carrier(name: str) -> None:
    """Wait until the interface is up, at most CARRIER_SECONDS.

    The kernel detects the carrier asynchronously, and silently drops frames until then. After the
    timeout, continue, because some kernels never report the state.
    """
    until = time.monotonic() + CARRIER_SECONDS
    while STATE_UP not in run_ip("-o", "link", "show", name) and time.monotonic() < until:
        time.sleep(CHECK_SECONDS)


def disable_ipv6(name: str) -> None:
    """Disable IPv6, because a real EtherCAT cable carries no router solicitations."""
    with contextlib.suppress(OSError):  # no IPv6 in this kernel, or /proc/sys is read-only
        Path("/proc/sys/net/ipv6/conf", name, "disable_ipv6").write_text("1")


def run_ip(*arguments: str) -> str:
    """Run `ip` and return its output. Raises OSError with the error output if it fails."""
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def main(arguments: Sequence[str]) -> None:
    """Run Python with `arguments` in a private network, or in the current one if refused.

    With "--probe", only send a frame in the current network. Exit with the reason if this fails.
    """
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
