"""A six-axis cobot under torque control, by six tasks: `make cobot`.

    python cobot.py                    virtual drives and a simulated arm, in virtual time
    python cobot.py --realtime         the same on the machine's clock
    python cobot.py --realtime eth0    the robot

Twice all joints go from 0 to 90 degrees and back; the second time the key is hit on the way.
"""

import argparse
import contextlib
import time
from pathlib import Path

import numpy as np

import catenary as cat
from catenary import control, realtime, record
from catenary.bench.cobot import Outcome, report
from catenary.demo.wire import on_a_wire
from catenary.virtual import read_segment

HERE = Path(__file__).parent
PERIOD, JOINTS = 1e-3, 6  # [s]
GOALS, KEY_AT = [np.full(JOINTS, goal) for goal in (np.pi / 2, 0, np.pi / 2, 0)], 3.8  # [s]
AXES = {  # as the data sheets of drives and gears say; limits [rad/s]
    "counts_per_turn": 2**17,
    "gear_ratio": [121, 121, 121, 101, 101, 101],
    "direction": [1, 1, -1, 1, -1, 1],
    "velocity_limit": [2.6, 2.6, 2.6, 3.1, 3.1, 3.1],
}
LIMITS = control.MotionLimits(velocity=1.5, acceleration=4.0, jerk=40.0)
GAINS = control.Cascade(
    position=control.Pid(JOINTS, 12.0, limit=2.5),  # [1/s] → rad/s
    velocity=control.Pid(JOINTS, [150, 150, 60, 15, 15, 8], limit=[430, 430, 195, 79, 79, 79]),
)
# [N·m·s/rad], [N·m], [kg·m²]: at the joints, as identified
FRICTION = control.Friction(JOINTS, [7.3, 7.3, 4.4, 1.5, 1.5, 1.5], [7.3, 7.3, 3.6, 1.5, 1.5, 1.5])
ROTORS = control.FeedForward(JOINTS, inertia=[1.46, 1.46, 0.59, 0.15, 0.15, 0.15])
FOLLOWING_ERROR, REACH = 0.2, 3.05  # [rad]
SILENCE, PATIENCE = 5, 3000  # cycles without news from the dynamics: stop, give up
COST = (40e-6, 130e-6, 25e-6, 300e-6, 5e-3, 10e-6)  # [s] declared in virtual time, in that order
STARTING, MOVING, STOPPED = range(3)


def dynamics(task, cost, state, torque, arm):
    """What the motion takes [N·m]: gravity, Coriolis, inertia, friction."""
    model, axes = control.Dynamics(arm, axes=JOINTS), range(JOINTS)
    friction, rotors = FRICTION.parameters, ROTORS.parameters
    for _ in task:
        q, v, speed, acceleration, _ = state.read()
        feed = model.inverse(q, v, acceleration)
        feed += [control.friction(friction, i, speed[i]) for i in axes]
        feed += [control.feed_forward(rotors, i, speed[i], acceleration[i]) for i in axes]
        torque.write(feed)
        task.spend(cost)


def trajectory(task, cost, state, phase, rows, done):
    """Motions to the goals, one after the other, a few rows ahead of the main control."""
    left = None
    for _ in task:
        task.spend(cost)
        number = int(done.read())
        if phase.read() != MOVING or number == len(GOALS):
            left = None
        elif left is None and not len(rows):  # begins where the reference stands
            motion = control.trajectory(state.read()[4], GOALS[number], LIMITS, PERIOD)
            left = list(np.stack([motion.position, motion.velocity, motion.acceleration], 1))
        while left and rows.put(left[0]):
            left.pop(0)
        if left == [] and not len(rows):
            left = None
            done.write(number + 1)


def monitor(task, cost, name, key):
    """What an operator sees; here also who hits the key."""
    with cat.attach(name, patience=task) as arm:
        for job in task:
            if job.number % 100 == 0:
                print(f"{job.time:5.1f} s  joints {np.degrees(arm.read()['position']).round(1)}")
            if abs(job.time - KEY_AT) < task.period / 2:
                key.set()
            task.spend(cost)


def log(task, cost, name, path):
    """Every cycle, into an MCAP file."""
    with cat.attach(name, patience=task) as arm, record.Recorder(arm, path, force=True) as recorder:
        for _ in task:
            recorder.take()
            task.spend(cost)


def stop(task, cost, stops):
    """Above all others, and asleep until the key is hit."""
    for job in task:
        stops.write(job.number + 1)
        task.spend(cost)


def why_stop(cycle, arm, wanted, key, silence):
    """What the arm must not go on with; None: nothing."""
    q = arm.actual.position
    reasons = {
        "key": key,
        "lost bus": cycle.lost > 1,
        "drive fault": arm.faults,
        "limit": max(abs(q)) > REACH,
        "following error": max(abs(wanted - q)) > FOLLOWING_ERROR,
        "silent dynamics": silence > SILENCE,
    }
    return next((reason for reason, there in reasons.items() if there), None)


def main_control(place, cost, target, share, compensate, state, torque, phase, rows, done, stops):
    """The bus, and the cascade of every joint. Returns its timing, its stops (cycle, [s], reason)
    and how many times faster than real time it was."""
    parameters, nothing = GAINS.parameters.tolist(), np.zeros(JOINTS)  # lists are faster here
    now, since, stopped, heard, silence, handled = STARTING, 0.0, [], 0, 0, 0
    options = {"run": "inline", "period": PERIOD, "priority": 90, "raise_faults": False}
    with cat.MainDevice(read_segment(target, clock=place) if place else target) as main:
        arm = cat.Drives(main.scan().drives, mode="cst", **AXES)
        with cat.Loop(arm, sink=share, lost_limit=50, **options) as loop:
            began = time.perf_counter()
            for cycle in loop:
                q, v = arm.actual.position, arm.actual.velocity
                row = rows.take()
                speed = acceleration = nothing  # where no row is there: hold
                if now != MOVING:
                    wanted, memory = q.copy(), GAINS.memory.tolist()  # of now
                elif row is not None:
                    wanted, speed, acceleration = row
                state.write([q, v, speed, acceleration, wanted])
                news = torque.number
                silence, heard = (silence + 1) * (news == heard), news
                feed = torque.read() if compensate else nothing
                arm.target.position[:] = wanted  # for the recording: the mode is torque
                joints = zip(*(each.tolist() for each in (wanted, speed, feed, q, v)), strict=True)
                arm.target.torque[:] = [
                    control.cascade(memory, parameters, i, *joint, PERIOD)
                    for i, joint in enumerate(joints)
                ]
                cycle.spend(cost)
                asked = int(stops.read())
                reason = why_stop(cycle, arm, wanted, asked > handled, silence if heard else 0)
                if now != STOPPED and reason:
                    arm.quick_stop()
                    now, since, handled = STOPPED, cycle.time, asked
                    stopped.append((cycle.number, cycle.time, reason))
                    print(f"{cycle.time:5.1f} s  stopped: {reason}")
                elif reason:  # the wait begins anew; a reset is an edge, again and again
                    since, handled = cycle.time, asked
                    if cycle.number % 100 == 0:
                        (arm.disable, arm.reset_faults)[cycle.number // 100 % 2]()
                elif now == STOPPED and cycle.time > since + 1.0:
                    arm.enable()
                    now, since = STARTING, cycle.time
                elif now == STARTING and arm.enabled.all() and heard:
                    now = MOVING
                elif now == STARTING and cycle.time > since + 5.0:
                    raise RuntimeError(
                        "the drives cannot be enabled: safe torque off, main supply?"
                    )
                phase.write(now)
                if done.read() >= len(GOALS) or silence > PATIENCE:
                    break
            return loop.timing, stopped, cycle.time / (time.perf_counter() - began)


def run(target, *, virtual, compensate, arm, folder):
    """One run of the whole program."""
    state, torque = realtime.Value("f8", (5, JOINTS)), realtime.Value("f8", JOINTS)
    rows, key = realtime.Queue("f8", (3, JOINTS), length=8), realtime.Signal()
    phase, done, stops = (realtime.Value("i4") for _ in range(3))
    name = "cobot" if compensate else "cobot-without"
    path = folder / f"{name}.mcap"
    c, cpu = (COST, 0) if virtual else ((0.0,) * 6, None)
    kept, lost = ({"cpu": cpu, "on_failure": policy} for policy in ("restart", "continue"))
    tasks = realtime.Tasks(
        realtime.Task(dynamics, (c[0], state, torque, arm), period=1e-3, priority=95, **kept),
        realtime.Task(
            trajectory, (c[2], state, phase, rows, done), period=2e-3, priority=85, **kept
        ),
        realtime.Task(monitor, (c[3], name, key), period=10e-3, priority=80, **kept),
        realtime.Task(log, (c[4], name, path), period=0.1, priority=75, **lost),
        realtime.Task(stop, (c[5], stops), period=0.01, priority=99, trigger=key, **kept),
        clock=realtime.VirtualClock() if virtual else None,
        session=realtime.session(best_effort=True),
        best_effort=True,
    )
    with cat.Share(name) as share, tasks:
        given = (c[1], target, share, compensate, state, torque, phase, rows, done, stops)
        outcome = tasks.beside(main_control, *given, priority=90, cpu=cpu)
    return Outcome(path, *outcome, tasks)


if __name__ == "__main__":  # the tasks' processes import this file
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", nargs="?", help="a network interface; else virtual drives")
    parser.add_argument("--realtime", action="store_true", help="on the machine's clock")
    parser.add_argument("--headless", action="store_true", help="writes no plots")
    parser.add_argument("--arm", default=str(HERE / "arm.xml"), help="MJCF or URDF of the arm")
    parser.add_argument("--segment", default=str(HERE / "segment.toml"), help="the virtual drives")
    parser.add_argument("--out", type=Path, default=Path("out"), help="where files go")
    a = parser.parse_args()
    if a.target and not a.realtime:
        parser.error(f"{a.target} lives by the machine's clock: add --realtime")
    a.out.mkdir(exist_ok=True)
    options = {"virtual": not a.realtime, "arm": a.arm, "folder": a.out}
    given = contextlib.nullcontext(a.target or a.segment)
    with on_a_wire(a.segment) if a.realtime and not a.target else given as target:
        outcomes = [run(target, compensate=each, **options) for each in (True, False)]
    report(*outcomes, a.out, plots=not a.headless)
