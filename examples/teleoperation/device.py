"""One of two coupled devices of two axes, over UDP: a leader that is moved, or its follower.

    python -m catenary.teleoperation.key arm.key        once; copy it to the other machine
    python device.py follower eth0 --bind 0.0.0.0:7002 --remote 192.168.1.10:7001 --key arm.key
    python device.py leader eth0 --bind 0.0.0.0:7001 --remote 192.168.1.20:7002 --key arm.key

Without a network interface, the drives are virtual, and a simulated hand moves the leader. Both
sides send their positions. Each feels the other through a spring and a damper, without a force
sensor. With `--feedback`, the leader feels a part of the follower's torque instead. Without a
link, a side holds its position compliantly; see docs/how_to/teleoperation.md.
"""

import argparse
import logging
import sys
import time
from collections import deque
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
from coupling_laws import AXES, COUNTS, INERTIA, PERIOD, STIFFNESS, controller

import catenary as cat
from catenary import control, realtime, teleoperation
from catenary.teleoperation.key import VARIABLE
from catenary.virtual import Joint, Plant, Segment, Servo

HERE = Path(__file__).parent
KEPT = 600_000  # newest cycles that --out keeps: 10 minutes


class Link:
    """Exchange of positions and energies with the other side, once per cycle.

    A packet has four axes. The first two hold positions, velocities and torques of the springs. The
    others hold the energies of the port: taken, returned, and the newest received value of
    returned. Energies count from the start of the other program, and are divided by `weight`.
    """

    nothing = teleoperation.PeerSample(*[(0.0,) * 2 * AXES] * 3, holding=True)

    def __init__(self, peer, weight):
        self.peer, self.weight = peer, weight
        self.newest, self.session = self.nothing, 0
        self.taken = self.returned = np.zeros(AXES)  # when the other program began

    def receive(self, energies):
        """Return `connected`, positions, energies for `control.passivity`, and spring torques."""
        sample = self.peer.receive()
        if self.peer.other_session != self.session:
            self.newest, self.session = self.nothing, self.peer.other_session
            self.taken, self.returned = energies.taken, energies.returned
        self.newest = sample or self.newest
        holds = self.newest.holding or self.newest.wants_stop
        connected = self.peer.state is teleoperation.LinkState.CONNECTED and not holds
        taken, their, echo = (np.array(row[AXES:]) for row in self.newest[:3])
        remote = self.weight * (taken - their - echo) - self.taken
        return connected, self.newest.position[:AXES], remote, self.newest.force[:AXES]

    def send(self, arm, energies, springs):
        """Send the state of this side."""
        taken = (energies.taken - self.taken) / self.weight
        returned = (energies.returned - self.returned) / self.weight
        self.peer.send(
            teleoperation.PeerSample(
                (*arm.actual.position, *taken),
                (*arm.actual.velocity, *returned),
                (*springs, *self.newest.velocity[AXES:]),
            )
        )


class Cycle(NamedTuple):
    """Values of one cycle; sequences have one number per axis."""

    time: float  # of the hand, or of the loop of a follower [s]
    stamp: float  # CLOCK_MONOTONIC [s]
    position: tuple[float, ...]  # [rad]
    torque: tuple[float, ...]  # [N·m]
    observed: tuple[float, ...]  # energy of the coupling [J]
    hand: tuple[float, ...]  # torque of the hand [N·m]
    delay: float  # largest of both directions together in the last 10 s [s]; NaN without a link
    connected: bool

    @property
    def row(self):
        """Values as one row of numbers."""
        return np.hstack(self)


def hand_path(now):
    """Return the position that the hand wants [rad]. The last two steps are into the block."""
    place = 0.0
    for begin, end, change in ((1.0, 2.0, 0.2), (3, 4, 0.2), (5, 6, 0.2)):
        s = min(max((now - begin) / (end - begin), 0.0), 1.0)
        place += change * s**3 * (10 - 15 * s + 6 * s**2)
    return place


class Hand:
    """Passive hand: a spring and a damper that follow a path, until the hand lets go."""

    stiffness, damping, lets_go = 10.0, 0.1, 7.5  # [N·m/rad], [N·m·s/rad], [s]

    def __init__(self, servo):
        self.servo, self.torque = servo, (0.0,) * AXES
        self.time = 0.0  # [s]

    def push(self, actual):
        """Apply the torque of this cycle to the shafts."""
        pull = self.stiffness * (hand_path(self.time) - actual.position)
        holds = self.time < self.lets_go
        self.torque = tuple((holds * (pull - self.damping * actual.velocity)).tolist())
        for axis, torque in enumerate(self.torque):
            self.servo.apply_load(torque, axis)


@contextmanager
def virtual_device(role, *, clock="virtual"):
    """Yield a segment with two drives, and the hand of a leader."""
    servo = Servo(axes=AXES, inertia=INERTIA, viscous_friction=2e-3, coulomb_friction=2e-3)
    plant = Plant(HERE / f"{role}.xml", [Joint("left"), Joint("right")])
    yield Segment([servo], plant=plant, clock=clock), Hand(servo) if role == "leader" else None


def cycles(target, hand, side, peer, *, watchdog=0.02, waits=False):
    """Run one side with a `Controller`. Yield a `Cycle` after each cycle.

    `watchdog` [s] is that of the drives. If `waits`, the hand begins with the first connection.
    """
    link, number, before = Link(peer, side.weight), 0, 0.0
    with cat.MainDevice(target) as main:
        drives = main.scan().drives
        arm = cat.Drives(drives, mode="cst", counts_per_turn=COUNTS, velocity_limit=50.0)
        options = {"period": PERIOD, "execution": "inline", "watchdog": watchdog}
        with cat.Loop(arm, laws=[side.law], **options) as loop:
            zeros = [0.0] * AXES
            silent = side.parameters(0, 0, arm.actual.position, zeros, zeros)
            run = loop.start(side.law, side.memory, silent)
            for cycle in loop:
                number += 1
                memory = run.memory
                energies = control.energies(control.part(memory, 1))
                connected, *received = link.receive(energies)
                run.parameters = side.parameters(connected, number, *received)
                link.send(arm, energies, control.part(memory, 2)[-AXES:])
                if hand is not None:
                    waits = waits and not connected
                    hand.time += 0.0 if waits else cycle.time - before
                    hand.push(arm.actual)
                before = cycle.time
                yield Cycle(
                    cycle.time if hand is None else hand.time,
                    time.monotonic(),
                    tuple(arm.actual.position.tolist()),
                    tuple(arm.actual.torque.tolist()),
                    tuple(energies.observed.tolist()),
                    hand.torque if hand is not None else (0.0,) * AXES,
                    np.nan if peer.delay_bound is None else peer.delay_bound,
                    connected,
                )


class Report:
    """Owner of the last line about the link."""

    def __init__(self, peer):
        self.peer, self.last, self.at = peer, None, -np.inf

    def step(self, now):
        """Print the state of the link if it changes, and a new reason at most once per second."""
        state, reason = self.peer.state, self.peer.reason
        if (state, reason) == self.last or (state is self.state and now - self.at < 1.0):
            return
        self.last, self.at = (state, reason), now
        print(f"{now:6.2f} s  link {state.value} {reason}".rstrip(), flush=True)

    @property
    def state(self):
        """State of the last line; None before the first one."""
        return self.last and self.last[0]


def run(target, hand, given, side, peer):
    """Run one side until the end of its time, or Ctrl-C. Write its cycles if a file is given."""
    # Virtual drives run on busy machines.
    options = {"watchdog": 0.02 if given.target else 0.2, "waits": True}
    kept, begun, report = deque(maxlen=KEPT), time.monotonic(), Report(peer)
    print(f"{given.role}: {STIFFNESS:g} N·m/rad, {side.damping:.3g} N·m·s/rad", flush=True)
    try:
        with closing(cycles(target, hand, side, peer, **options)) as running:
            for cycle in running:
                report.step(time.monotonic() - begun)
                if given.out:
                    kept.append(cycle.row)
                if given.seconds is not None and cycle.time > given.seconds:
                    break
    except KeyboardInterrupt:
        pass
    counted = {name: count for name, count in peer.counters.items() if count}
    print(f"{given.role}: {peer.losses} losses of the link; packets: {counted}", flush=True)
    if given.out:
        np.save(given.out, np.array(kept))


def arguments(words=None):
    """Return the arguments of the command line. The target may follow the options."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("role", choices=["leader", "follower"])
    parser.add_argument("target", nargs="?", help="network interface; default: virtual drives")
    parser.add_argument(
        "--bind",
        required=True,
        metavar="HOST:PORT",
        help="this side, such as 0.0.0.0:7001",
    )
    parser.add_argument("--remote", required=True, metavar="HOST:PORT", help="the other side")
    parser.add_argument(
        "--key",
        type=Path,
        metavar="FILE",
        help=f"key file; default: the environment, {VARIABLE}",
    )
    for name, default, text in (
        ("max-delay", 0.05, "bound of the delay of both directions together [s]; default: 0.05"),
        ("damping", None, "[N·m·s/rad]; default: by the delay"),
        ("added", 0.0, "largest damping of the passivity controller [N·m·s/rad]; default: 0"),
        ("feedback", None, "only of a leader: reflect this part of the follower's torque, not P+d"),
        ("seconds", None, "duration [s], for a leader from the first connection; default: Ctrl-C"),
    ):
        parser.add_argument(f"--{name}", type=float, default=default, metavar="N", help=text)
    parser.add_argument("--out", type=Path, metavar="FILE", help="the newest cycles (.npy)")
    given = parser.parse_intermixed_args(words)
    if given.role == "follower" and given.feedback is not None:
        parser.error("--feedback is an option of the leader; the follower needs none")
    return given


def main():
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    given = arguments()
    side = controller(given.max_delay, given.damping, feedback=given.feedback, added=given.added)
    key = teleoperation.read_key(given.key)
    transport = teleoperation.UdpTransport(given.bind, given.remote)
    peer = teleoperation.Peer(transport, key=key, axes=2 * AXES, max_delay=given.max_delay)
    device = nullcontext((given.target, None))
    if not given.target:
        device = virtual_device(given.role, clock="monotonic")
    with peer, device as (target, hand), realtime.session(best_effort=True):
        run(target, hand, given, side, peer)


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError, cat.CatenaryError) as error:
        sys.exit(f"error: {error}")
