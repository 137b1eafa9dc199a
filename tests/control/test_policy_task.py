"""A policy in a task of its own, and a reader at 1 kHz: NaN, late and killed policies.

The machine is simulated: `task.spend` stands for the time that the policy computes.
"""

import math
import signal
from typing import Any

import numpy as np
import pytest

from catenary import control, realtime
from tests.control import policy_tasks
from tests.control.policy_tasks import PHASES, RULE


def balance(observation: np.ndarray) -> np.ndarray:
    """Return the observation, but NaN from 0.2 s to 0.4 s."""
    return observation if not 0.2 <= observation[0] < 0.4 else observation * math.nan


def think(task: Any, actions: Any, late: tuple[float, float], seen: list[str]) -> None:
    """Run the policy at 100 Hz. One job computes for long, in the time `late`."""
    policy = control.Policy(balance, inputs=1, rule=RULE)
    for job in task:
        action = policy.step([job.time], job.time)
        seen.append(policy.status.phase)
        task.spend(late[1] if math.isclose(job.time, late[0]) else 1e-3)
        actions.write(action)


def act(task: Any, actions: Any, rows: list[tuple[float, float, str]]) -> None:
    reader = control.ActionReader(actions, RULE)
    for job in task:
        rows.append((job.time, float(reader.read(job.time)[0]), reader.status.phase))


def run(late: tuple[float, float], duration: float) -> tuple[dict[int, tuple[float, str]], list]:
    actions, seen, rows = realtime.Value("f8", 1), [], []
    with (
        realtime.VirtualClock() as clock,
        realtime.Tasks(
            realtime.Task(think, (actions, late, seen), period=10e-3, priority=50, on_miss="skip"),
            realtime.Task(act, (actions, rows), period=1e-3, priority=90, cpu=1),
            workers="threads",
            clock=clock,
        ) as tasks,
    ):
        tasks.join(duration)
    return {round(time * 1e3): (action, phase) for time, action, phase in rows}, seen


def test_a_nan_of_the_policy_does_not_reach_the_reader_and_decays() -> None:
    read, seen = run(late=(9.0, 0.0), duration=0.5)
    assert seen[15:25] == ["ok"] * 5 + ["held"] * 3 + ["decaying"] * 2
    assert seen[36:42] == ["neutral"] * 4 + ["ok"] * 2
    assert np.isfinite([action for action, _ in read.values()]).all()
    assert read[215][0] == pytest.approx(0.19)  # the last good action
    assert read[399][0] == 0.0
    assert read[405][0] == pytest.approx(0.40)


def test_a_policy_that_computes_for_300_ms_decays_at_the_reader_and_returns() -> None:
    read, seen = run(late=(0.1, 0.3), duration=0.5)
    assert seen[:11] == ["ok"] * 11  # the policy itself does not notice it
    assert read[90] == (pytest.approx(0.08), "ok")
    assert read[121] == (pytest.approx(0.09), "ok")
    assert read[171][1] == "decaying"
    assert read[171][0] == pytest.approx(0.045, abs=1e-3)
    assert read[230] == (0.0, "neutral")
    assert read[390] == (0.0, "neutral")
    assert read[402] == (pytest.approx(0.4), "ok")


def test_a_policy_that_never_starts_leaves_the_action_neutral() -> None:
    read, _ = run(late=(0.0, 1.0), duration=0.3)
    assert set(read.values()) == {(0.0, "neutral")}


@pytest.mark.parametrize("on_failure", ["continue", "restart"])
def test_a_killed_policy_decays_or_is_restarted(on_failure: str) -> None:
    """The kernel kills the process of the policy in its job at 200 ms."""
    actions, rows = realtime.Value("f8", 1), realtime.Queue("f8", 3, length=1000)
    policy = control.Policy(policy_tasks.ramp, inputs=1, rule=RULE)
    with (
        realtime.VirtualClock() as clock,
        realtime.Tasks(
            realtime.Task(
                policy_tasks.think, (policy, actions), period=10e-3, on_failure=on_failure
            ),
            realtime.Task(policy_tasks.act, (actions, rows), period=1e-3, cpu=1),
            workers="processes",
            clock=clock,
        ) as tasks,
    ):
        tasks.join(0.6)
        failures = [failure.exit_code for failure in tasks.failures]
    assert failures == [-signal.SIGKILL]
    read = {}
    while (row := rows.take()) is not None:
        read[round(row[0] * 1e3)] = (row[1], PHASES[int(row[2])])
    assert read[199] == (pytest.approx(0.19), "ok")
    assert read[206] == (pytest.approx(0.19), "ok")
    if on_failure == "continue":
        assert read[271][1] == "decaying"
        assert read[330] == read[599] == (0.0, "neutral")
    else:  # restarted at its next release
        assert read[215] == (pytest.approx(0.21), "ok")
        assert read[599] == (pytest.approx(0.59), "ok")
