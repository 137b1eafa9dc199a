"""Tasks of the humanoid. Each runs in its own process, and exchanges Values with the loop.

Each function receives the running task, the declared execution time of a job [s], and the Values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import arms
import balance
import body
import estimate
import hand
import mujoco
import numpy as np
import policy
import pose_source
from exchange import (
    COMMAND,
    ESTIMATE,
    HAND,
    HANDS,
    SAFETY,
    UPPER_JOINTS,
    Cause,
    Exchange,
    Mode,
)
from safety import Rules, Safety

import catenary as cat
from catenary import control, realtime, sensors

POSE = (sensors.Channel("position", "m", (3,)), sensors.Channel("quaternion", "", (4,)))
RULE = control.ActionRule(  # without a good action for 30 ms, it decays to zero in 0.1 s
    policy.ACTION, low=-policy.LIMIT, high=policy.LIMIT, rate=2.0, hold=0.03, decay=0.1
)
SILENCE = 0.1  # [s] age of the torques of a hand at which the springs of its arm return
FIELDS = [name for name in ESTIMATE.names if name in estimate.Estimate.__slots__]


def estimator(task: realtime.Running, cost: float, x: Exchange, model: str) -> None:
    """Estimate the base from the IMU, the joints and the force sensors."""
    known = estimate.Estimator(model)
    out, before = np.zeros((), ESTIMATE), 0.0
    for _ in fresh(task, x.state):
        state = x.state.read()
        now = float(state["time"])
        found = known.step(measurement(state), now - before)
        before = now
        for name in FIELDS:
            out[name] = getattr(found, name)
        out["tilt"], out["time"] = found.tilt, now
        out["fallen"] = bool(estimate.fallen(found, known.standing))
        x.estimate.write(out)
        task.spend(cost)


def measurement(state: np.ndarray) -> estimate.Measurement:
    """Return the values of a `STATE`, with NaN for lost sensors."""
    forces = np.where(state["feet_valid"][:, None] != 0, state["feet"][:, :3], np.nan)
    lost = 0.0 if state["imu_valid"] else np.nan
    return estimate.Measurement(
        position=state["position"],
        velocity=state["velocity"],
        orientation=state["orientation"] + lost,
        gyro=state["gyro"] + lost,
        forces=forces,
    )


def dynamics(task: realtime.Running, cost: float, x: Exchange, model: str) -> None:
    """Compute the torque of gravity and motion of the upper body, at the rate of the loop.

    The legs are left to the balance: their torques depend on the contacts of the feet.
    """
    rigid = body.load_model(model)
    data = mujoco.MjData(rigid)
    places, speeds = body.position_indices(rigid), body.velocity_indices(rigid)
    for _ in fresh(task, x.state):
        state = x.state.read()
        data.qpos[places], data.qvel[speeds] = state["position"], state["velocity"]
        data.qpos[3:7] = state["orientation"] if state["imu_valid"] else (1.0, 0.0, 0.0, 0.0)
        data.qvel[3:6] = state["gyro"] * state["imu_valid"]
        mujoco.mj_fwdPosition(rigid, data)
        mujoco.mj_fwdVelocity(rigid, data)
        x.gravity.write(data.qfrc_bias[speeds])
        task.spend(cost)


def balancing(task: realtime.Running, cost: float, x: Exchange, model: str) -> None:
    """Compute goals and torques of all joints: the legs balance, the arms follow their motion."""
    feedback, plain = balance.Balance(model), balance.Balance(model, feedback=False)
    actions, hands = control.ActionReader(x.policy, RULE), Hands(x, task.period)
    out = np.zeros((), COMMAND)
    for job in fresh(task, x.estimate):
        mode, found = x.state.read()["mode"], of_record(x.estimate.read())
        action = actions.read(job.time)
        follows = mode == Mode.BALANCE and x.policy.number and actions.status.phase == "ok"
        if follows or mode != Mode.BALANCE:
            feedback.reset()
        goal, torque = (plain if follows else feedback).step(found, task.period)
        if mode != Mode.BALANCE:
            goal, torque = plain.step(found, task.period)
        out["position"], out["torque"], out["policy"] = goal, torque, follows
        if x.policy.number and mode == Mode.BALANCE:
            out["position"] += action  # without a usable policy, it decays to zero
        if mode != Mode.DAMPING and x.arms.number:
            motion = x.arms.read()
            out["position"][:UPPER_JOINTS] = motion["position"]
            out["velocity"][:UPPER_JOINTS] = motion["velocity"]
        if x.gravity.number:
            out["torque"][:UPPER_JOINTS] = x.gravity.read()[:UPPER_JOINTS]
        hands.add(out)
        x.command.write(out)
        task.spend(cost)


class Hands:
    """Reader of the torques of `operator_hand`. They end when this task is silent.

    Args:
        x: the Values.
        period: time between two calls [s].
    """

    def __init__(self, x: Exchange, period: float) -> None:
        self._value, self._silence = x.hand, realtime.Silence(x.hand)
        self._most = SILENCE / period

    def read(self) -> np.ndarray:
        """Return the newest `HAND`; zeros if it is too old. Call it once per job."""
        is_silent = self._silence.look() > self._most
        return np.zeros((), HAND) if is_silent else self._value.read()

    def add(self, command: np.ndarray) -> None:
        """Replace the springs of an arm by its Cartesian impedance, while that is active."""
        command["scale"] = 1.0
        found = self.read()
        for rows, active, torque in zip(hand.ROWS, found["active"], found["torque"], strict=True):
            if active:
                command["scale"][rows] = 0.0
                command["velocity"][rows] = 0.0
                command["torque"][rows] += torque


def operator_hand(
    task: realtime.Running, cost: float, x: Exchange, model: str, namespace: str
) -> None:
    """Let the hands follow poses of ROS 2. A preset ends it, until the next pose."""
    with pose_source.pose_source(namespace) as source:
        if source is not None:
            follow(task, cost, x, model, source)


def follow(
    task: realtime.Running, cost: float, x: Exchange, model: str, source: pose_source.PoseSource
) -> None:
    followers: list[hand.Hand | None] = [None] * HANDS
    served, out = 0, np.zeros((), HAND)
    for _ in fresh(task, x.state):
        state, serial = x.state.read(), int(x.preset.read()[0])
        if serial != served or state["mode"] == Mode.DAMPING:
            served = serial
            source.drop()
        q, v = state["position"], state["velocity"]
        for side, pose in enumerate(source.step()):
            out["active"][side] = pose is not None
            if pose is None:
                followers[side] = None
                continue
            follower = followers[side] or hand.Hand(side, model, q)
            out["torque"][side] = follower.step(pose, q, v, task.period)
            followers[side] = follower
        x.hand.write(out)
        task.spend(cost)


def policy_slot(
    task: realtime.Running, cost: float, x: Exchange, model: str, source: Path | Callable
) -> None:
    """Run a policy at 100 Hz. A bad action is replaced by its rule, and reported."""
    slot = control.Policy(source, inputs=policy.OBSERVATION, rule=RULE)
    observe, before = policy.PolicyBalance(slot.step, model).observation, "ok"
    for job in fresh(task, x.estimate):
        action = slot.step(observe(of_record(x.estimate.read())), job.time)
        if slot.status.phase == "ok":
            x.policy.write(action)
        if slot.status.phase != before:
            before = slot.status.phase
            print(f"{job.time:8.3f} s  policy: {slot.status}", flush=True)
        task.spend(cost)


def of_record(found: np.ndarray) -> estimate.Estimate:
    """Return an `ESTIMATE` as an object."""
    return estimate.Estimate(**{name: found[name] for name in FIELDS})


def arm_motion(task: realtime.Running, cost: float, x: Exchange) -> None:
    """Move the arms to the poses of the requested preset.

    The reference of an arm without springs follows the arm, so that its springs start without a
    jump. After a restart, the task continues from its last reference, at home.
    """
    motion, out, served = None, x.arms.read(), int(x.preset.read()[0])
    hands = Hands(x, task.period)
    for _ in fresh(task, x.state):
        state, (serial, preset) = x.state.read(), x.preset.read()
        position = np.clip(state["position"], body.LOW, body.HIGH)[:UPPER_JOINTS]
        is_damped, active = state["mode"] == Mode.DAMPING, hands.read()["active"]
        if is_damped or active.any():
            motion, served = None, serial if is_damped else served
            for rows in (slice(None),) if is_damped else rows_of(active):
                out["position"][rows] = position[rows]
            out["velocity"], out["moving"] = 0.0, 0
        else:
            if motion is None:
                start = out["position"] if x.arms.number else position
                motion = arms.Arms(start, task.period)
                motion.run("home")
            if serial != served:
                motion.run(arms.NAMES[preset])
                served = serial
            reference = motion.step()
            out["position"], out["velocity"] = reference.position, reference.velocity
            out["moving"] = motion.moving
        x.arms.write(out)
        task.spend(cost)


def rows_of(active: np.ndarray) -> list[slice]:
    """Return the rows of the arms with an active hand."""
    return [rows for rows, one in zip(hand.ROWS, active, strict=True) if one]


def safety(task: realtime.Running, cost: float, x: Exchange, silence: float) -> None:
    """Decide whether the robot may move, at the highest priority."""
    decision, out = Safety(Rules(silence=silence)), np.zeros((), SAFETY)
    watched = {
        Cause.SILENT_LOOP: realtime.Silence(x.state),
        Cause.SILENT_ESTIMATOR: realtime.Silence(x.estimate),
        Cause.SILENT_BALANCE: realtime.Silence(x.command),
    }
    for job in task:
        ages = {cause: each.look() * task.period for cause, each in watched.items()}
        found = x.estimate.read()
        tilt = np.pi if found["fallen"] else float(found["tilt"])
        decision.step(job.time, task.period, x.state.read(), tilt, ages)
        out["verdict"], out["cause"] = decision.verdict, decision.cause
        x.safety.write(out)
        task.spend(cost)


def base_pose(task: realtime.Running, cost: float, x: Exchange, name: str) -> None:
    """Publish the estimated pose of the pelvis, for the 3D view of the operator's page."""
    with sensors.SensorShare(name, POSE, rate=1 / task.period) as share:
        for job in fresh(task, x.estimate):
            found = x.estimate.read()
            pose = {"position": found["base_position"], "quaternion": found["orientation"]}
            share.publish(pose, job.release_ns)
            task.spend(cost)


def log(task: realtime.Running, cost: float, names: tuple[str, ...], folder: Path) -> None:
    """Record every cycle of both networks in compressed MCAP files."""
    from catenary import record

    with ExitStack() as stack:
        recorders = []
        for name in names:
            share = stack.enter_context(cat.attach(name, patience=task))
            path = folder / f"{name}.mcap"
            recorders.append(stack.enter_context(record.Recorder(share, path, force=True)))
        for _ in task:
            for recorder in recorders:
                recorder.take()
            task.spend(cost)


def fresh(task: realtime.Running, value: realtime.Value) -> Iterator[object]:
    """Yield the jobs of a task for which `value` has been written at least once."""
    for job in task:
        if value.number:
            yield job
