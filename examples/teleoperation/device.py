"""One of two coupled devices of two axes, over UDP: a leader that is moved, or its follower.

    python -m catenary.teleoperation.key arm.key        once; copy it to the other machine
    python device.py follower --bind 0.0.0.0:7002 --remote 192.168.1.10:7001 --key arm.key eth0
    python device.py leader --bind 0.0.0.0:7001 --remote 192.168.1.20:7002 --key arm.key eth0

Without a network interface, the drives are virtual, and a simulated hand moves the leader. Both
sides send their positions. Each feels the other through a spring and a damper, without a force
sensor. Without a link, a side holds its position compliantly; see docs/how_to/teleoperation.md.
"""

import argparse
import logging
import sys
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np

import catenary as cat
from catenary import control, realtime, teleoperation
from catenary.virtual import Joint, Plant, Segment, Servo

HERE = Path(__file__).parent
PERIOD, AXES = 1e-3, 2  # [s]
STIFFNESS = 2.0  # [N·m/rad] of the coupling, and of holding without a link
INERTIA = 1.5e-3  # [kg·m²], of an axis with its motor
FASTEST = 5.0  # [rad/s]
COUNTS = 2**20
# The condition counts the delay from a measurement to the end of its effect. The link measures from
# sending to reception. A position waits up to one cycle before, and one cycle until the law starts.
WAITING = 4 * PERIOD  # of both directions
REACTION = 4 * PERIOD  # twice the reaction of a loop, see control.Coupling
SILENCE = 0.02  # [s] without a new cycle of this program, after which the law holds
MARGIN = 1.1  # of the damping


@cat.law
def couple(actual, target, memory, parameters):
    spring, port, seen = control.part(memory, 0), control.part(memory, 1), control.part(memory, 2)
    gains, watch = control.part(parameters, 0), control.part(parameters, 1)
    link = control.part(parameters, 2)  # connected, cycle, positions, energies of the other side
    seen[1] = seen[1] + actual.dt if link[1] == seen[0] else 0.0
    seen[0] = link[1]
    connected = link[0] if seen[1] < SILENCE else 0.0
    for i in range(actual.n):
        q, v, dt = actual.position[i], actual.velocity[i], actual.dt
        pull = control.coupling(spring, gains, i, link[2 + i], connected, q, v, dt)
        target.torque[i] = control.passivity(port, watch, i, pull, link[4 + i], q, v, dt)


def damping_for(max_delay):
    """Return a damping [N·m·s/rad] that permits a delay [s] of both directions together."""
    return MARGIN * STIFFNESS * ((max_delay + WAITING) / 2 + REACTION)


def gains_for(max_delay, damping=None):
    """Return the coupling of one side, the same on both. Raises ValueError if it is not stable."""
    damping = damping_for(max_delay) if damping is None else damping
    return control.Coupling(
        AXES, STIFFNESS, damping, max_delay + WAITING, PERIOD, align=0.5, inertia=INERTIA
    )


class Link:
    """Exchange of positions and energies with the other side, once per cycle.

    A packet has four axes. The first two hold positions, velocities and torques. The others hold
    the energies of the port: taken, returned, and the newest received value of returned.
    """

    def __init__(self, peer):
        self.peer = peer
        self.newest = teleoperation.PeerSample(*[(0.0,) * 2 * AXES] * 3)
        self.stopped = False  # by the other side

    def receive(self):
        """Return `connected`, the positions, and the energies for `control.passivity`."""
        sample = self.peer.receive()
        if sample is not None:
            self.newest, self.stopped = sample, sample.wants_stop
        connected = self.peer.state is teleoperation.LinkState.CONNECTED and not self.stopped
        taken, their, echo = (np.array(row[AXES:]) for row in self.newest[:3])
        return connected, self.newest.position[:AXES], taken - their - echo

    def send(self, arm, energies):
        """Send the state of this side."""
        self.peer.send(
            teleoperation.PeerSample(
                (*arm.actual.position, *energies.taken),
                (*arm.actual.velocity, *energies.returned),
                (*arm.actual.torque, *self.newest.velocity[AXES:]),
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


def cycles(target, hand, gains, peer, *, watchdog=0.02, added=0.0, waits=False):
    """Run one side. Yield a `Cycle` after each cycle.

    `watchdog` [s] is that of the drives. `added` [N·m·s/rad] is the largest damping that the
    passivity controller adds. If `waits`, the hand begins with the first connection.
    """
    quantum = 2 * np.pi / COUNTS
    watch = control.Passivity(AXES, STIFFNESS, FASTEST, PERIOD, quantum, damping=added)
    link, number, before = Link(peer), 0, 0.0
    with cat.MainDevice(target) as main:
        drives = main.scan().drives
        arm = cat.Drives(drives, mode="cst", counts_per_turn=COUNTS, velocity_limit=50.0)
        options = {"period": PERIOD, "execution": "inline", "watchdog": watchdog}
        with cat.Loop(arm, laws=[couple], **options) as loop:
            memory = control.join(gains.memory, watch.memory, [0.0, 0.0])
            silent = [0.0, 0.0, *arm.actual.position, *[0.0] * AXES]
            run = loop.start(
                couple, memory, control.join(gains.parameters, watch.parameters, silent)
            )
            for cycle in loop:
                number += 1
                energies = control.energies(control.part(run.memory, 1))
                connected, positions, remote = link.receive()
                values = [float(connected), float(number), *positions, *remote]
                run.parameters = control.join(gains.parameters, watch.parameters, values)
                link.send(arm, energies)
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


def report(peer, before, now):
    """Print a change of the link. Return its state."""
    if peer.state is not before:
        print(f"{now:6.2f} s  link {peer.state.value} {peer.reason}".rstrip(), flush=True)
    return peer.state


def run(role, target, hand, given):
    """Run one side until the end of its time, or Ctrl-C. Write its cycles if a file is given."""
    # Virtual drives run on busy machines.
    options = {"watchdog": 0.02 if given.target else 0.2, "added": given.added, "waits": True}
    gains = gains_for(given.max_delay, given.damping)
    transport = teleoperation.UdpTransport(given.bind, given.remote)
    key, kept = teleoperation.read_key(given.key), []
    with teleoperation.Peer(transport, key=key, axes=2 * AXES, max_delay=given.max_delay) as peer:
        state = peer.state
        print(
            f"{role}: {STIFFNESS:g} N·m/rad, {gains.damping:.3g} N·m·s/rad; link {state.value}",
            flush=True,
        )
        try:
            for cycle in cycles(target, hand, gains, peer, **options):
                state = report(peer, state, cycle.time)
                kept.append(cycle.row)
                if given.seconds is not None and cycle.time > given.seconds:
                    break
        except KeyboardInterrupt:
            pass
        print(
            f"{role}: {peer.losses} losses of the link; packets:",
            {name: count for name, count in peer.counters.items() if count},
            flush=True,
        )
    if given.out:
        np.save(given.out, np.array(kept))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("role", choices=["leader", "follower"])
    parser.add_argument("target", nargs="?", help="network interface; default: virtual drives")
    parser.add_argument("--bind", required=True, help="address of this side, HOST:PORT")
    parser.add_argument("--remote", required=True, help="address of the other side, HOST:PORT")
    parser.add_argument("--key", type=Path, help="key file; default: the environment")
    parser.add_argument("--max-delay", type=float, default=0.05, help="both directions [s]")
    parser.add_argument("--damping", type=float, help="[N·m·s/rad]; default: by the delay")
    parser.add_argument(
        "--added", type=float, default=0.0, help="damping of the passivity controller"
    )
    parser.add_argument("--seconds", type=float, help="duration; default: until Ctrl-C")
    parser.add_argument("--out", type=Path, help="file of the cycles (.npy)")
    return parser.parse_args()


def main():
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    given = arguments()
    device = nullcontext((given.target, None))
    if not given.target:
        device = virtual_device(given.role, clock="monotonic")
    with device as (target, hand), realtime.session(best_effort=True):
        run(given.role, target, hand, given)


if __name__ == "__main__":
    try:
        main()
    except (ValueError, cat.CatenaryError) as error:
        sys.exit(f"error: {error}")
