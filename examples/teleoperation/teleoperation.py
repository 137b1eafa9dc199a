"""Two coupled devices over networks with delay and losses: `make teleoperation`.

    python teleoperation.py                 all networks, in virtual time
    python teleoperation.py --realtime      two programs over UDP, with a relay, in real time
    python teleoperation.py --only 20       networks whose name begins with "20"
    python teleoperation.py --feedback 0.5  the leader feels half of the follower's torque, not P+d

A simulated hand moves the left and right axis of the leader. The left axis of the follower meets
a block. The table and the plot are in the output folder.
"""

import argparse
import contextlib
import dataclasses
import json
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from coupling_laws import AXES, PERIOD, controller
from device import HERE, cycles, virtual_device
from results import Result, plot, table

from catenary import teleoperation
from catenary.errors import CatenaryError

DURATION = 10.0  # [s], of `device.hand_path`
ROLES = "leader", "follower"
SLACK = 0.05  # [s], added to the bounds in real time: programs of a shared machine may be late
PATIENCE = 60.0  # [s] for the start and the end of a program
PORTS = 47301, 47302, 47303, 47304  # leader, follower, relay for each of them


@dataclasses.dataclass(frozen=True)
class Network:
    """A network, the bound of its delay, and the gains of both sides."""

    name: str
    model: teleoperation.NetworkModel
    max_delay: float  # [s], both directions together, with jitter, losses and hold times
    gains_delay: float | None = None  # [s], for which the gains are made; None: max_delay
    added: float = 0.0  # largest damping that the passivity controller adds [N·m·s/rad]


def network(name, max_delay, *, gains_delay=None, added=0.0, **model):
    model = teleoperation.NetworkModel(seed=1, **model)
    return Network(name, model, max_delay, gains_delay, added)


NETWORKS = (
    network("0 ms", 0.012),
    network("20 ms", 0.052, delay=0.02),
    network("100 ms", 0.212, delay=0.1),
    network("20 ms, 5 % lost", 0.065, delay=0.02, loss=0.05),
    network("5 to 45 ms, 5 % lost", 0.12, delay=0.005, jitter=0.04, loss=0.05, reorder=0.02),
    network("20 ms, off 5.5-6.5 s", 0.052, delay=0.02, outages=((5.5, 6.5),)),
    network("B of 0 ms at 100 ms", 0.212, delay=0.1, gains_delay=0.012),
    network("B of 0 ms at 100 ms, controlled", 0.212, delay=0.1, gains_delay=0.012, added=0.4),
)


class Clock:
    """Time of both sides, which run in lockstep."""

    now_ns = 0


def controllers(case, feedback):
    """Return the controllers of the leader and of the follower."""
    delay = case.gains_delay or case.max_delay
    follower = controller(delay, added=case.added)
    if feedback is None:
        return follower, follower
    return controller(delay, feedback=feedback, added=case.added), follower


def simulate(case, feedback):
    """Run both sides over a network in virtual time. Return the result."""
    path = teleoperation.VirtualNetwork(case.model)
    clock, key = Clock(), secrets.token_bytes(32)
    made = controllers(case, feedback)
    rows = [], []
    with contextlib.ExitStack() as stack:
        sides, peers = [], []
        for number, role in enumerate(ROLES):
            transport = path.side(number, clock)
            options = {"key": key, "axes": 2 * AXES, "max_delay": case.max_delay}
            peers.append(stack.enter_context(teleoperation.Peer(transport, **options)))
            segment, hand = stack.enter_context(virtual_device(role))
            side = cycles(segment, hand, made[number], peers[-1])
            sides.append(stack.enter_context(contextlib.closing(side)))
        for leader, follower in zip(*sides, strict=True):
            clock.now_ns += round(PERIOD * 1e9)
            for kept, cycle in zip(rows, (leader, follower), strict=True):
                kept.append(cycle.row)
            if leader.time > DURATION:
                break
        losses = max(peer.losses for peer in peers)
    return Result(case.name, made[0], np.array(rows[0]), np.array(rows[1]), losses)


def in_real_time(case, feedback, folder):
    """Run two programs and the relay over UDP on this machine. Return the result.

    Raises CatenaryError if a program fails, or does not end in time.
    """
    key = folder / "arm.key"
    teleoperation.make_key(key)
    leader, follower, *relay = (f"127.0.0.1:{port}" for port in PORTS)
    model = dataclasses.asdict(case.model)
    words = [f"--{name}={model[name]}" for name in ("delay", "jitter", "loss", "reorder", "seed")]
    between = [f"{relay[0]}={leader}", f"{relay[1]}={follower}", *words]
    programs = [start("-m", "catenary.teleoperation.relay", *between)]
    with contextlib.ExitStack() as stack:
        stack.callback(end, programs)
        for role, bind, remote in zip(ROLES, (leader, follower), relay, strict=True):
            options = ["--bind", bind, "--remote", remote, "--key", key, "--out", folder / role]
            options += ["--max-delay", case.max_delay]
            if role == "leader":
                options += ["--seconds", DURATION]
                options += [] if feedback is None else ["--feedback", feedback]
            programs.append(start(HERE / "device.py", role, *options))
        wait(programs, "leader", DURATION + PATIENCE)
        programs[2].send_signal(signal.SIGINT)
        wait(programs, "follower", PATIENCE)
    rows = [np.load(folder / f"{role}.npy") for role in ROLES]
    return Result.aligned(case.name, controllers(case, feedback)[0], *rows)


def start(*words):
    return subprocess.Popen([sys.executable, *map(str, words)])


def wait(programs, role, seconds):
    """Wait for the end of a side. Raises CatenaryError if a program fails, or it takes longer."""
    until = time.monotonic() + seconds
    one = programs[1 + ROLES.index(role)]
    while one.poll() is None:
        for name, program in zip(("relay", *ROLES), programs, strict=True):
            if program.poll():
                raise CatenaryError(f"the {name} has failed; see its message above")
        if time.monotonic() > until:
            raise CatenaryError(
                f"the {role} has not ended within {seconds:g} s",
                hint="if its link did not connect, give this machine less other work",
            )
        time.sleep(0.1)
    if one.returncode:
        raise CatenaryError(f"the {role} has failed; see its message above")


def end(programs):
    for program in programs:
        program.terminate()
        try:
            program.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()


def run(case, given):
    """Run a network. Return the result."""
    print(f"{case.name} ...", flush=True)
    if not given.realtime:
        return simulate(case, given.feedback)
    with tempfile.TemporaryDirectory() as folder:
        return in_real_time(case, given.feedback, Path(folder))


def arguments(words=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--realtime", action="store_true", help="two programs over UDP")
    parser.add_argument("--only", default="", metavar="NAME", help="first letters of the networks")
    parser.add_argument(
        "--feedback",
        type=float,
        metavar="N",
        help="the leader feels this part of the follower's torque, instead of P+d",
    )
    parser.add_argument("--headless", action="store_true", help="write no plot")
    parser.add_argument("--out", type=Path, default=Path("out"), help="output folder")
    given = parser.parse_args(words)
    given.networks = chosen(given)
    if not given.networks:
        names = ", ".join(repr(case.name) for case in NETWORKS)
        parser.error(f"no network of this mode begins with {given.only!r}: {names}")
    return given


def chosen(given):
    """Return the networks to run."""
    found = [case for case in NETWORKS if case.name.startswith(given.only)]
    if given.realtime or given.feedback is not None:  # unstable gains need no second proof
        found = [case for case in found if case.gains_delay is None]
    if given.realtime:  # the relay has no outages
        found = [case for case in found if not case.model.outages]
        found = [dataclasses.replace(each, max_delay=each.max_delay + SLACK) for each in found]
    return found


def main():
    given = arguments()
    for case in given.networks:
        controllers(case, given.feedback)  # refuses gains before the first run
    given.out.mkdir(parents=True, exist_ok=True)
    results = [run(case, given) for case in given.networks]
    print(table(results))
    rows = [result.summary for result in results]
    (given.out / "teleoperation.json").write_text(json.dumps(rows, indent=1))
    if not given.headless:
        plot(results, given.out / "teleoperation.png")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError, CatenaryError) as error:
        sys.exit(f"error: {error}")
