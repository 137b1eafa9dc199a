"""A six-axis cobot under torque control with six tasks: `make cobot`.

    python cobot.py                    virtual drives and a simulated arm, in virtual time
    python cobot.py --realtime         the same on the machine's clock
    python cobot.py --realtime eth0    the robot

All joints move to 90 degrees and back, twice. Enter stops them. On virtual drives, the program
presses it.
"""

import argparse
import sys
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np
import ruckig  # noqa: F401  of trajectories: not in the first of them

import catenary as cat
from catenary import control, realtime, record
from catenary.demo.terminal import on_enter
from catenary.demo.wire import program_target
from catenary.ros2 import backend, messages
from catenary.virtual import read_segment

sys.path.append(str(Path(__file__).resolve().parents[2]))  # the repository has `benchmarks`
from benchmarks.cobot import Measured, Outcome, report

with suppress(ImportError):  # each task imports this file before its first release
    import catenary.ros2.cyclone

HERE = Path(__file__).parent
PERIOD, JOINTS = 1e-3, 6  # [s]
GOALS, KEY_AT = [np.full(JOINTS, goal) for goal in (np.pi / 2, 0, np.pi / 2, 0)], 3.8  # [s]
JOINT_NAMES = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")  # of arm.xml
AXES = {  # as the data sheets of drives and gears say; limits [rad/s]
    "counts_per_turn": 2**17,
    "gear_ratio": [121, 121, 121, 101, 101, 101],
    "direction": [1, 1, -1, 1, -1, 1],
    "velocity_limit": [2.6, 2.6, 2.6, 3.1, 3.1, 3.1],
}
LIMITS = control.MotionLimits(1.5, 4.0, 40.0, -3.05, 3.05)  # [rad/s], ... to [rad]
GAINS = control.Cascade(
    position=control.Pid(JOINTS, 12.0, limit=2.5),  # [1/s] → rad/s
    velocity=control.Pid(JOINTS, [150, 150, 60, 15, 15, 8], limit=[430, 430, 195, 79, 79, 79]),
)
# [N·m·s/rad], [N·m], [kg·m²]: at the joints, as identified
FRICTION = control.Friction(JOINTS, [7.3, 7.3, 4.4, 1.5, 1.5, 1.5], [7.3, 7.3, 3.6, 1.5, 1.5, 1.5])
ROTORS = control.FeedForward(JOINTS, inertia=[1.46, 1.46, 0.59, 0.15, 0.15, 0.15])
FOLLOWING_ERROR, REACH = 0.2, 2.9  # [rad]
SILENCE = 5  # cycles without a sign of life from a task, after which the arm stops
PATIENCE = 3000  # cycles without the bus, after which the program ends


def dynamics(task, cost, state, torque, model, gravity):
    """Return the torque of the motion [N·m]: gravity, Coriolis, inertia, friction."""
    friction, rotors = FRICTION.parameters.tolist(), ROTORS.parameters.tolist()  # faster as lists
    for _ in task:
        _, speed, acceleration, q, v = state.read()
        feed = model.inverse(q, v, acceleration) - (0 if gravity else model.gravity(q))
        for i, (v, a) in enumerate(zip(speed.tolist(), acceleration.tolist(), strict=True)):
            feed[i] += control.friction(friction, i, v) + control.feed_forward(rotors, i, v, a)
        torque.write(feed)
        task.spend(cost)


def trajectory(task, cost, state, phase, rows, done, goals):
    """Plan the motions to the goals, a few rows ahead of the main control."""
    motion, number = None, int(done.read())
    for _ in task:
        task.spend(cost)
        if phase.read() != cat.drive.Phase.RUNNING or number == len(goals):
            motion = None
        elif motion is None and not len(
            rows
        ):  # starts from the reference, which mostly stands still
            begin = control.MotionState(*state.read()[:3])
            motion, sent = control.trajectory(begin, goals[number], LIMITS, task.period / 2), 0
        while motion and sent < len(motion) and rows.put(motion.row(sent)):
            sent += 1
        if motion and sent == len(motion) and not len(rows):
            motion, number = None, number + 1
        done.write(number)  # also a sign of life


def ros2(task, cost, name, key, key_at):
    """Publish the joint states for ROS 2, and print them. On virtual drives, press the key."""
    seen = 0
    with ros2_node() as node, cat.attach(name, patience=task) as arm:
        publish = joint_states(node, arm.layout)
        for job in task:
            publish(row := arm.read())
            if job.number % 100 == 0:
                print(f"{job.time:5.1f} s  joints {np.degrees(row['position']).round(1)}")
            for event in arm.events(after=seen)[0]:
                print(f"{job.time:5.1f} s  {event.message}")
                seen = event.serial
            if key_at and abs(job.time - key_at) < task.period / 2:
                key.set()
            task.spend(cost)


@contextmanager
def ros2_node():
    """Yield a node of ROS 2; None without `pip install 'catenary[ros2]'` and without rclpy."""
    try:
        node = backend.open_backend("cobot", namespace="cobot")
    except cat.errors.ConfigurationError as error:
        print(f"ROS 2: no joint states are published: {error}")
        yield None
        return
    with closing(node):
        yield node


def joint_states(node, layout):
    """Return a function that publishes a cycle on /cobot/joint_states; a no-op without a node."""
    if node is None:
        return lambda row: None
    publisher = node.publisher("joint_states", messages.JointState)

    def publish(row):
        stamp = messages.Time.from_ns(int(row["scheduled_ns"]) + layout.utc_offset_ns)
        rows = [row[name].tolist() for name in ("position", "velocity", "torque")]
        publisher.publish(messages.JointState(messages.Header(stamp), JOINT_NAMES, *rows))

    return publish


def log(task, cost, name, path):
    """Record every cycle in an MCAP file."""
    with cat.attach(name, patience=task) as arm, record.Recorder(arm, path, force=True) as recorder:
        for _ in task:
            recorder.take()
            task.spend(cost)


def stop(task, cost, hit):
    """Wait for the key, at the highest priority."""
    for job in task:
        hit.write(job.release_ns)
        task.spend(cost)


def why_stop(wanted, q, v, signs):
    """Return the reason for a stop, from these signs and others; None without one."""
    joints = list(zip(wanted, q, v, strict=True))
    signs["limit"] = any(
        abs(q) > REACH and q * v > 0.01 for _, q, v in joints
    )  # not on the way back to the reference
    signs["following error"] = any(abs(wanted - q) > FOLLOWING_ERROR for wanted, q, _ in joints)
    return next((sign for sign, there in signs.items() if there), None)


def main_control(place, cost, period, target, share, state, torque, phase, rows, done, goals, hit):
    """Run the bus and the cascades, and wait for a lost bus. Return the data of an `Outcome`."""
    parameters = GAINS.parameters.tolist()
    wanted = speed = nothing = np.zeros(JOINTS)
    handled = lost = 0
    silences = realtime.Silence(torque), realtime.Silence(done)
    options = {"execution": "inline", "period": period, "priority": 90}
    stop = cat.StopPolicy(raise_faults=False)
    with cat.MainDevice(read_segment(target, clock=place) if place else target) as main:
        arm = cat.Drives(main.scan().drives, mode="cst", required=False, **AXES)
        recovery, measured = cat.drive.Recovery(arm), Measured(virtual=bool(place))
        with cat.Loop(arm, sink=share, watchdog=0.02, stop=stop, **options) as loop:
            for cycle in loop:
                q, v = arm.actual.position, arm.actual.velocity
                row = rows.take()
                dry = row is None and recovery.phase == cat.drive.Phase.RUNNING and speed.any()
                if recovery.phase != cat.drive.Phase.RUNNING:  # follows the arm
                    row, memory = (q.copy(), nothing, nothing), GAINS.memory.tolist()
                wanted, speed, acceleration = (wanted, nothing, nothing) if row is None else row
                state.write([wanted, speed, acceleration, q, v])
                arm.target.position[:] = wanted  # for the recording: the mode is torque
                each = [row.tolist() for row in (wanted, speed, torque.read(), q, v)]
                for i, joint in enumerate(zip(*each, strict=True)):
                    arm.target.torque[i] = control.cascade(memory, parameters, i, *joint, period)
                cycle.spend(cost)
                lost = 0 if arm.present.all() else lost + 1
                if lost > PATIENCE:
                    raise cat.CatenaryError(f"the bus has been lost for {PATIENCE} cycles")
                silence = [each.look() for each in silences]
                before, handled = handled, hit.number
                signs = {"key": handled > before, "lost bus": lost > 1, "dry set-points": dry}
                signs |= {"silent dynamics": silence[0] > SILENCE, "drive fault": arm.faults}
                reason = why_stop(each[0], each[3], each[4], signs)
                phase.write(recovery.step(cycle, reason, ready=torque.number > 0))
                if recovery.just_stopped:
                    when = hit.read() * 1e-9 if reason == "key" else None
                    main.mark(f"stop: {reason}", time=when)
                measured.look(cycle.time)
                if done.read() == len(goals) or max(silence) > PATIENCE:
                    break
            return loop.timing, recovery.stops, measured


def run(
    target, *, virtual, gravity, arm, folder, name="cobot", key_at=KEY_AT, goals=GOALS, stretch=1.0
):
    """Run the whole program once, with or without gravity compensation."""
    state, torque = realtime.Value("f8", (5, JOINTS)), realtime.Value("f8", JOINTS)
    rows, key = realtime.Queue("f8", (3, JOINTS), length=8), realtime.Signal()
    phase, done, hit = (realtime.Value("i8") for _ in range(3))
    without = "" if gravity else "-without"
    name, path = name + without, folder / f"cobot{without}.mcap"
    model = control.Dynamics(arm, axes=JOINTS)

    def task(function, cost, *arguments, on_failure="restart", **more):  # [s], in virtual time
        more |= {"cpu": 0 if virtual else None, "period": more["period"] * stretch}
        return realtime.Task(function, (cost * virtual, *arguments), on_failure=on_failure, **more)

    tasks = realtime.Tasks(
        task(dynamics, 40e-6, state, torque, model, gravity, period=1e-3, priority=95),
        task(trajectory, 25e-6, state, phase, rows, done, goals, period=2e-3, priority=85),
        task(ros2, 300e-6, name, key, key_at, period=10e-3, priority=80),
        task(log, 5e-3, name, path, period=0.1, priority=75, on_failure="continue"),
        task(stop, 10e-6, hit, period=0.01, priority=99, trigger=key),
        clock=realtime.VirtualClock() if virtual else None,
        session=realtime.session(best_effort=True),
        best_effort=True,
    )
    with cat.Share(name) as share, tasks, on_enter(key.set):
        given = (target, share, state, torque, phase, rows, done, goals, hit)
        given = (main_control, 130e-6 * virtual, PERIOD * stretch, *given)
        outcome = tasks.beside(*given, priority=90, cpu=0 if virtual else None)
    return Outcome(path, *outcome, tasks)


if __name__ == "__main__":  # the tasks' processes import this file
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", nargs="?", help="a network interface (virtual drives)")
    parser.add_argument("--realtime", action="store_true", help="on the machine's clock")
    parser.add_argument("--headless", action="store_true", help="write no plots")
    parser.add_argument("--short", action="store_true", help="one run, with gravity compensated")
    parser.add_argument("--stretch", type=float, default=1.0, help="factor of all periods")
    parser.add_argument("--arm", default=str(HERE / "arm.xml"), help="MJCF or URDF of the arm")
    parser.add_argument("--segment", default=str(HERE / "segment.toml"), help="the virtual drives")
    parser.add_argument("--name", default="cobot", help="name of its share")
    parser.add_argument("--out", type=Path, default=Path("out"), help="output folder")
    a = parser.parse_args()
    if a.target and not a.realtime:
        parser.error(f"{a.target} lives by the machine's clock: add --realtime")
    a.out.mkdir(exist_ok=True)
    options = {"virtual": not a.realtime, "arm": a.arm, "folder": a.out, "name": a.name}
    options |= {"key_at": None if a.target else KEY_AT, "stretch": a.stretch}
    with program_target(a.segment, a.target, realtime=a.realtime) as target:
        outcomes = [run(target, gravity=each, **options) for each in (True, False)[: 2 - a.short]]
    report(a.out, *outcomes, plots=not a.headless)
