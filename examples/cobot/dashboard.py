"""A simulated cobot on a ring, moving endlessly, for the operator's page: `make dashboard`.

The drives are virtual, and a compliant controller in position mode moves them. In the page:

- push a body of the robot with the mouse: the arm gives way and returns
- pull a cable: the ring continues from both ends, and an event names the cable
- press STOP: the arm stops and waits. Enable its axes to jog them. The arm continues its motion
  after 10 s in which all axes are enabled and none is jogged.
"""

import argparse
import subprocess
import sys
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np

import catenary as cat
from catenary import control
from catenary.virtual import read_segment

HERE = Path(__file__).parent
PERIOD, JOINTS = 1e-3, 6  # [s]
LONGEST_STEP = 0.02  # [s] of the motion, if the machine has delayed the program
AXES = {  # as the data sheets of drives and gears say; limits [rad/s]
    "names": ["base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3"],
    "counts_per_turn": 2**17,
    "gear_ratio": [121, 121, 121, 101, 101, 101],
    "direction": [1, 1, -1, 1, -1, 1],
    "velocity_limit": [2.6, 2.6, 2.6, 3.1, 3.1, 3.1],
}
CENTER = np.array([0.0, 0.3, 0.9, 0.0, 0.6, 0.0])  # [rad]
AMPLITUDE = np.array([0.9, 0.35, 0.5, 0.5, 0.5, 1.2])  # [rad]
RATE = 2 * np.pi / np.array([16.0, 8.0, 8.0, 8.0, 16.0, 8.0])  # [rad/s], repeats after 16 s
APPROACH, WAIT = 4.0, 10.0  # [s] to the start of the motion; before it continues
# Compliance: virtual mass, damper and spring of each joint, in SI units. The mass is at least that
# of the arm: a smaller one makes the controller react to its own acceleration.
INERTIA = np.array([8.0, 8.0, 3.0, 0.5, 0.5, 0.5])
DAMPING = np.array([60.0, 60.0, 25.0, 6.0, 6.0, 6.0])
STIFFNESS = np.array([50.0, 50.0, 25.0, 8.0, 8.0, 8.0])
FRICTION = np.array([16.0, 16.0, 9.0, 3.5, 3.5, 3.5])  # [N·m], torques below are not a push
SMOOTHING = 0.02  # [s], time constant of the torques from outside
PUSH = np.array([100.0, 100.0, 60.0, 30.0, 30.0, 30.0])  # [N·m], at most
GIVES_WAY, GIVES_WAY_SPEED = 0.5, 1.0  # [rad], [rad/s], at most


def path(time):
    """Return the positions of the endless motion at `time` [s], (6,) [rad]."""
    return CENTER + AMPLITUDE * np.sin(RATE * time)


def smooth(share):
    """Return a value from 0 to 1 that starts and ends without velocity and acceleration."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


class Compliance:
    """Deviation from the motion [rad] that yields to torques from outside."""

    def __init__(self, model):
        self.model = model
        self.outside, self.offset, self.speed = np.zeros((3, JOINTS))

    def step(self, actual, dt):
        """Return the deviation, (6,) [rad], `dt` [s] later, from the measured values."""
        known = self.model.inverse(actual.position, actual.velocity, np.zeros(JOINTS))
        self.outside += (known - actual.torque - self.outside) * dt / SMOOTHING
        push = np.sign(self.outside) * np.clip(abs(self.outside) - FRICTION, 0.0, PUSH)
        force = push - DAMPING * self.speed - STIFFNESS * self.offset
        speed = self.speed + dt * force / INERTIA
        self.speed = np.clip(speed, -GIVES_WAY_SPEED, GIVES_WAY_SPEED)
        self.offset = np.clip(self.offset + dt * self.speed, -GIVES_WAY, GIVES_WAY)
        return self.offset

    def reset(self):
        """Forget the deviation."""
        self.outside, self.offset, self.speed = np.zeros((3, JOINTS))


class Motion:
    """The endless motion, which waits while an axis is stopped or jogged."""

    def __init__(self, start):
        self.begin(start)
        self.waiting = 0.0  # [s] until the motion continues; 0: it moves

    def begin(self, start):
        """Approach the start of the motion from `start` (6,) [rad]."""
        self.start, self.time = start.copy(), -APPROACH

    def step(self, arm, compliance, dt):
        """Write the targets of the arm, `dt` [s] after those before."""
        ready = arm.enabled.all() and not arm.jogged.any()
        if not ready:
            self.waiting = WAIT
        elif self.waiting > 0:
            self.waiting -= dt
            if self.waiting <= 0:
                self.begin(arm.target.position)
                compliance.reset()
        elif self.time < 0:
            self.time = min(self.time + dt, 0.0)
            way = path(0.0) - self.start
            arm.target.position[:] = self.start + smooth(1 + self.time / APPROACH) * way
        else:
            self.time += dt
            arm.target.position[:] = path(self.time) + compliance.step(arm.actual, dt)


@contextmanager
def page(name, port):
    """Serve the page during the block, and yield its process. It prints the links."""
    command = [sys.executable, "-m", "catenary.cli", "dashboard", name, "--port", str(port)]
    server = subprocess.Popen([*command, "--model", str(HERE / "arm.xml"), "--recordings", "."])
    try:
        yield server
    finally:
        server.terminate()
        try:
            server.wait(5.0)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


def run(name, seconds, server):
    """Run the robot until `seconds` have passed (None: until Ctrl-C) or `server` has ended."""
    model = control.Dynamics(HERE / "arm.xml", axes=JOINTS)
    segment = read_segment(HERE / "segment.toml", clock="monotonic", ring=True)
    stop = cat.StopPolicy(  # late_limit=0: on a busy machine, the arm waits for the program
        raise_faults=False, on_axis_stopped="event", lost_limit=20, late_limit=0
    )
    with (
        cat.MainDevice(segment.first, segment.second) as bus,
        cat.Share(name, jog=True) as share,
    ):
        arm = cat.Drives(bus.scan().drives, mode="csp", required=False, **AXES)
        with cat.Loop(arm, period=PERIOD, watchdog=1.0, sink=share, stop=stop) as loop:
            compliance, motion, before = Compliance(model), Motion(arm.target.position), 0.0
            print(f"the arm moves; its share is {name!r}. Press Ctrl-C to end", flush=True)
            for cycle in loop:
                motion.step(arm, compliance, min(cycle.time - before, LONGEST_STEP))
                before = cycle.time
                if seconds is not None and cycle.time > seconds:
                    break
                if server and cycle.number % 1000 == 0 and server.poll() is not None:
                    break


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--name", default="cobot", help="name of its share")
    parser.add_argument("--seconds", type=float, help="duration; default: until Ctrl-C")
    parser.add_argument("--page", action="store_true", help="also serve the operator's page")
    parser.add_argument("--port", type=int, default=8710, help="port of the page")
    a = parser.parse_args()
    serving = page(a.name, a.port) if a.page else nullcontext()
    with suppress(KeyboardInterrupt), serving as server:
        run(a.name, a.seconds, server)
