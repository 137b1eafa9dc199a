"""Jogs in the core: generator, dead-man, requested states, stop word (core/_jog.pyx)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.core import (
    AXIS_FOLLOWED,
    CYCLE_DROPPED,
    REQUEST_DISABLED,
    REQUEST_ENABLED,
    Stream,
)
from catenary.plan.cycle import AxisLimits
from catenary.plan.stop_reason import StopReason
from catenary.share.jog import JogStatus, RequestStatus
from tests.core.operator import Operator
from tests.core.rig import CSP, CST, CSV, MS, Bench, axis, bench

PV, PP = 3, 1
T = 1e-3
V, A, D = 1.0, 10.0, 20.0  # limits of the axis
EXECUTION_MODES = ("threaded", "inline")
DISABLE, ENABLE, QUICK_STOP, RESET = range(4)


def made(mode: int = CSP, *, jog: bool = True, execution: str = "threaded", **more: object):
    """One enabled axis at rest, whose application commits, and its operator."""
    options = {"limits": AxisLimits(velocity=V), "acceleration": A, "deceleration": D}
    b = bench(axis(0, mode=mode, standstill=0.05, **(options | more)), execution=execution)
    operator = Operator(b, jog=jog)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.axis_flags[0] & AXIS_FOLLOWED
    return b, operator


def jogged(b: Bench, operator: Operator, cycles: int, *, beats: bool = True) -> list[float]:
    """Run cycles with heartbeats. Return the commanded positions."""
    seen = []
    for _ in range(cycles):
        if beats:
            operator.beat()
        b.engine.next()
        seen.append(b.drives[0].target_position / 1000)
    return seen


def velocity_of(b: Bench) -> float:
    return b.drives[0].target_velocity / 1000


# ---- the press


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_press_moves_the_axis_at_its_velocity_until_release(execution: str) -> None:
    b, operator = made(execution=execution)
    operator.press(0.5)
    path = jogged(b, operator, 200)
    assert operator.status() is JogStatus.MOVING
    assert b.jogged[0] == 1
    assert not b.axis_flags[0] & AXIS_FOLLOWED
    assert path[-1] - path[-101] == pytest.approx(0.05, abs=2e-3)
    operator.release()
    jogged(b, operator, 60)
    assert operator.status() is JogStatus.RELEASED
    assert b.jogged[0] == 0
    assert b.axis_flags[0] & AXIS_FOLLOWED
    end = b.drives[0].target_position
    b.steps(100)
    assert b.drives[0].target_position == end  # the targets of the application start there
    assert b.target_position[0] == pytest.approx(end / 1000, abs=1e-3)


def test_without_permission_nothing_moves() -> None:
    b, operator = made(jog=False)
    operator.press(0.5)
    assert set(jogged(b, operator, 50)) == {0.0}
    assert operator.status() is JogStatus.REFUSED_NOT_ALLOWED


@pytest.mark.parametrize(
    ("values", "refusal"),
    [
        ((math.nan,), JogStatus.REFUSED_INVALID),
        ((math.inf,), JogStatus.REFUSED_INVALID),
        ((0.0,), JogStatus.REFUSED_INVALID),
        ((0.1, 0.0), JogStatus.REFUSED_INVALID),
        ((0.1, -1.0), JogStatus.REFUSED_INVALID),
        ((0.1, math.inf), JogStatus.REFUSED_INVALID),
        ((0.1, 1.0, 0.0), JogStatus.REFUSED_INVALID),
        ((0.1, 1.0, 1e-300), JogStatus.REFUSED_INVALID),
        ((0.1, 1.0, math.inf), JogStatus.REFUSED_INVALID),
    ],
)
def test_invalid_values_are_refused(values: tuple[float, ...], refusal: JogStatus) -> None:
    b, operator = made()
    operator.press(*values)
    assert set(jogged(b, operator, 20)) == {0.0}
    assert operator.status() is refusal


def test_a_disabled_axis_is_refused() -> None:
    b, operator = made()
    b.ask(REQUEST_DISABLED)
    b.steps(5)
    operator.press(0.5)
    b.steps(2)
    assert operator.status() is JogStatus.REFUSED_NOT_ENABLED


@pytest.mark.parametrize("mode", [CST, PP])
def test_torque_and_profile_position_are_refused(mode: int) -> None:
    b, operator = made(mode)
    operator.press(0.5)
    b.steps(2)
    assert operator.status() is JogStatus.REFUSED_MODE


def test_an_axis_that_the_application_moves_is_refused() -> None:
    b, operator = made()
    for _ in range(20):
        b.target_position[0] += 1e-4  # 0.1 rad/s
        b.engine.next()
    operator.press(0.5)
    b.target_position[0] += 1e-4
    b.engine.next()
    b.engine.next()
    assert operator.status() is JogStatus.REFUSED_MOVING


def test_a_second_press_ends_the_first_and_is_refused() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    operator.press(-0.5)
    path = jogged(b, operator, 100)
    assert operator.status() is JogStatus.REFUSED_MOVING
    assert b.jogged[0] == 0
    assert path[-1] == path[-50]
    operator.press(-0.5)
    jogged(b, operator, 2)
    assert operator.status() is JogStatus.MOVING


def test_a_press_whose_values_are_being_written_waits() -> None:
    b, operator = made()
    operator.press(0.5)
    operator.slots[0]["begun"] = 2
    assert set(jogged(b, operator, 20)) == {0.0}
    assert operator.status() is JogStatus.NONE


# ---- the dead-man


@pytest.mark.parametrize("execution", EXECUTION_MODES)
@pytest.mark.parametrize("mode", [CSP, CSV, PV])
def test_without_heartbeats_it_stops_within_200_ms_and_does_not_start_again(
    mode: int, execution: str
) -> None:
    b, operator = made(mode, execution=execution)
    operator.press(0.5)
    jogged(b, operator, 100)
    token = operator.token
    jogged(b, operator, 201 + 50, beats=False)
    assert operator.status() is JogStatus.EXPIRED
    assert b.jogged[0] == 0
    at = b.drives[0].target_position
    operator.beat(token=token)
    b.steps(50)
    operator.beat()  # a fresh one does not revive it
    b.steps(50)
    assert operator.status() is JogStatus.EXPIRED
    assert (b.drives[0].target_position, velocity_of(b)) == (at, 0.0)


def test_a_burst_of_old_heartbeats_extends_nothing() -> None:
    b, operator = made()
    operator.press(0.5)
    old = []
    for _ in range(150):
        operator.beat()
        old.append(operator.token)
        b.engine.next()
    moved = 0
    for k in range(400):
        operator.beat(token=old[k % len(old)])
        b.engine.next()
        moved += operator.status() is JogStatus.MOVING
    assert moved <= 201
    assert operator.status() is JogStatus.EXPIRED


def test_the_deadline_counts_from_the_issue_of_the_token() -> None:
    b, operator = made()
    while True:
        token = operator.token
        b.engine.next()
        if operator.token != token:  # issued in this cycle
            break
    issued, token = b.link.time, operator.token
    b.steps(45)
    operator.press(0.5, token=token)
    b.engine.next()
    assert operator.status() is JogStatus.MOVING
    while operator.status() is JogStatus.MOVING:
        operator.beat(token=token)  # repeated: it grants no more time
        b.engine.next()
    assert b.link.time - issued == pytest.approx(201 * MS, abs=2 * MS)


def test_a_press_with_an_old_token_is_refused() -> None:
    b, operator = made()
    token = operator.token
    b.steps(260)
    operator.press(0.5, token=token)
    b.steps(2)
    assert operator.status() is JogStatus.REFUSED_STALE


def test_a_heartbeat_of_another_press_extends_nothing() -> None:
    b, operator = made()
    operator.press(0.5)
    b.engine.next()
    for _ in range(300):
        operator.beat(press=0)
        b.engine.next()
    assert operator.status() is JogStatus.EXPIRED


@pytest.mark.parametrize("token", [0, 1, 2**48 - 1])
def test_a_token_that_was_not_issued_extends_nothing(token: int) -> None:
    b, operator = made()
    operator.press(0.5, token=token)
    b.steps(2)
    assert operator.status() is JogStatus.REFUSED_STALE


def test_a_pause_of_the_loop_expires_all_tokens() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    operator.beat()
    b.link.time += 1000 * MS  # as after SIGSTOP of the process of the loop
    b.engine.next()
    b.engine.next()
    assert operator.status() is JogStatus.STOPPING
    b.steps(60)
    assert operator.status() is JogStatus.EXPIRED


def test_the_dead_man_acts_while_the_application_computes() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    b.engine.spend(300 * MS)  # no heartbeat, no commit
    assert operator.status() is JogStatus.EXPIRED
    assert b.drives[0].state == 4
    at = b.drives[0].target_position
    b.engine.spend(300 * MS)  # the axis holds without a late limit
    assert (b.drives[0].state, b.drives[0].target_position) == (4, at)


def test_tokens_change_every_50_ms_and_do_not_repeat() -> None:
    b, operator = made()
    seen = []
    for _ in range(1000):
        b.engine.next()
        seen.append(operator.token)
    assert len(set(seen)) == pytest.approx(20, abs=1)
    assert all(0 < token < 2**48 for token in seen)


# ---- the generator


@pytest.mark.parametrize("velocity", [0.5, -0.5])
def test_a_step_ends_exactly_at_its_distance(velocity: float) -> None:
    b, operator = made()
    operator.press(velocity, 0.123)
    jogged(b, operator, 400)
    assert operator.status() is JogStatus.DONE
    assert b.target_position[0] == pytest.approx(math.copysign(0.123, velocity), abs=1e-9)


@pytest.mark.parametrize("velocity", [0.5, -0.5])
def test_it_stops_at_the_position_limit(velocity: float) -> None:
    limits = AxisLimits(velocity=V, position_min=-0.05, position_max=0.05)
    b, operator = made(limits=limits)
    operator.press(velocity)
    path = jogged(b, operator, 400)
    assert max(map(abs, path)) <= 0.05
    assert path[-1] == math.copysign(0.05, velocity)
    assert operator.status() is JogStatus.AT_LIMIT


def commanded(b: Bench) -> float:
    """Commanded position of the last cycle, not rounded to counts; read from the targets."""
    return float(b.target_position[0])


ACTIONS = st.lists(
    st.tuples(st.sampled_from(["beat", "old", "none", "release", "press"]), st.integers(1, 120)),
    max_size=12,
)


@settings(max_examples=150, deadline=None)
@given(
    velocity=st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-3),
    distance=st.one_of(st.just(math.nan), st.floats(1e-4, 1.0)),
    acceleration=st.one_of(st.just(math.nan), st.floats(0.5, 100.0)),
    actions=ACTIONS,
)
def test_no_interleaving_exceeds_a_limit(
    velocity: float, distance: float, acceleration: float, actions: list[tuple[str, int]]
) -> None:
    limits = AxisLimits(velocity=V, position_min=-0.3, position_max=0.2)
    b, operator = made(limits=limits)
    operator.press(velocity, distance, acceleration)
    path, old = [0.0], operator.token
    for action, cycles in [*actions, ("none", 400)]:
        if action == "press":
            operator.press(-velocity, distance, acceleration)
        for _ in range(cycles):
            if action in ("beat", "press"):
                operator.beat()
            elif action == "old":
                operator.beat(token=old)
            elif action == "release":
                operator.release()
            b.engine.next()
            path.append(commanded(b))
    assert b.jogged[0] == 0
    assert min(path) >= -0.3 - 1e-9
    assert max(path) <= 0.2 + 1e-9
    speeds = [(after - before) / T for before, after in pairwise(path)]
    assert max(map(abs, speeds)) <= V * (1 + 1e-6)
    changes = [abs(after - before) for before, after in pairwise([0.0, *speeds])]
    assert max(changes) <= D * T * (1 + 1e-6)
    assert path[-1] == path[-100]


@pytest.mark.parametrize("mode", [CSV, PV])
def test_a_velocity_mode_commands_the_velocity(mode: int) -> None:
    b, operator = made(mode)
    operator.press(0.5)
    jogged(b, operator, 100)
    assert velocity_of(b) == 0.5
    operator.release()
    jogged(b, operator, 1)
    assert velocity_of(b) == pytest.approx(0.5 - D * T, abs=1e-3)
    jogged(b, operator, 50)
    assert velocity_of(b) == 0.0
    assert operator.status() is JogStatus.RELEASED


@pytest.mark.parametrize("mode", [CSV, PV])
def test_a_step_in_a_velocity_mode_has_the_integral_of_its_distance(mode: int) -> None:
    b, operator = made(mode)
    operator.press(0.5, 0.1)
    total = 0.0
    for _ in range(400):
        operator.beat()
        b.engine.next()
        total += velocity_of(b) * T
    assert operator.status() is JogStatus.DONE
    assert total == pytest.approx(0.1, abs=1e-3)  # of velocities in counts


# ---- the application


def test_targets_of_the_application_are_ignored_during_a_jog() -> None:
    b, operator = made()
    operator.press(0.1)
    for _ in range(150):
        operator.beat()
        b.target_position[0] = -0.05
        b.engine.next()
    assert b.drives[0].target_position > 10


def test_the_application_gets_the_axis_back_without_a_jump() -> None:
    b, operator = made()
    operator.press(0.5, 0.05)
    path = []
    for _ in range(800):
        operator.beat()
        b.target_position[0] = 0.0  # an application that never reads
        b.engine.next()
        path.append(b.drives[0].target_position / 1000)
    speeds = np.diff(path) / T
    assert max(path) == 0.05
    assert path[-1] == 0.0
    assert np.abs(speeds).max() <= V + 1.0  # counts of 1 mrad
    assert b.drives[0].state == 4


def test_a_target_far_away_is_refused_after_a_jog_and_the_axis_holds() -> None:
    b, operator = made(limits=AxisLimits(velocity=V, step=0.01))
    operator.press(0.5, 0.2)
    for _ in range(1000):
        operator.beat()
        b.target_position[0] = 0.0
        b.engine.next()
    assert operator.status() is JogStatus.DONE
    assert b.drives[0].target_position == 200
    assert b.drives[0].state == 4


def test_a_stream_that_is_far_away_after_a_jog_stops_the_axis() -> None:
    """The other axes of a stream move on: this one must not stay behind in silence."""
    b, operator = made(limits=AxisLimits(velocity=V, step=0.01))
    operator.press(0.5, 0.2)
    jogged(b, operator, 100)
    stream = Stream(1, 8)
    b.engine.set_stream(stream)
    for _ in range(700):
        operator.beat()
        stream.write(np.zeros((1, 3)).tobytes(), b.engine.number)
        b.engine.next()
    assert operator.status() is JogStatus.DONE
    assert b.drives[0].target_position == 200
    assert StopReason(b.stop_reason[0]) is StopReason.REFUSED
    assert b.drives[0].state != 4


def test_a_request_of_the_application_ends_the_jog() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    b.ask(REQUEST_DISABLED)
    jogged(b, operator, 3)
    assert operator.status() is JogStatus.ENDED_STOPPED
    assert b.jogged[0] == 0
    assert b.drives[0].state != 4


def test_bit_12_that_is_lost_ends_the_jog() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    b.drives[0].follows = False
    jogged(b, operator, 10)
    assert operator.status() is JogStatus.ENDED_STOPPED


def test_a_device_that_is_lost_ends_the_jog() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    b.segment.silent.add(0)
    jogged(b, operator, 10)
    assert operator.status() is JogStatus.ENDED_STOPPED
    assert StopReason(b.stop_reason[0]) is StopReason.DEVICE_LOST


# ---- stop and requested states


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_the_stop_word_stops_all_axes_without_permission_to_jog(execution: str) -> None:
    b, operator = made(jog=False, execution=execution)
    operator.stop()
    assert b.engine.next() & CYCLE_DROPPED
    b.steps(3)
    assert StopReason(b.stop_reason[0]) is StopReason.OPERATOR
    assert b.drives[0].state != 4
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.drives[0].state == 4  # the word stops once


def test_the_stop_word_at_the_attachment_stops_nothing() -> None:
    b = bench(axis(0))
    operator = Operator(b)
    b.engine.stop()
    operator.stop()
    operator.attach()
    b.enable()
    b.steps(5)
    assert b.drives[0].state == 4


def test_the_stop_word_is_the_reason_of_a_disabled_axis_too() -> None:
    """The program must not enable it by itself, as it may do after another stop."""
    b, operator = made(jog=False)
    b.ask(REQUEST_DISABLED)
    b.steps(5)
    assert b.stop_reason[0] == 0
    operator.stop()
    assert not b.engine.next() & CYCLE_DROPPED
    b.steps(2)
    assert StopReason(b.stop_reason[0]) is StopReason.OPERATOR
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert (b.stop_reason[0], b.drives[0].state) == (0, 4)


def test_a_stop_ends_a_jog() -> None:
    b, operator = made()
    operator.press(0.5)
    jogged(b, operator, 100)
    operator.stop()
    jogged(b, operator, 2)
    assert operator.status() is JogStatus.ENDED_STOPPED
    assert b.drives[0].state != 4


def test_a_stop_wins_over_a_request_to_enable_of_the_same_cycle() -> None:
    b, operator = made()
    b.ask(REQUEST_DISABLED)
    b.steps(5)
    operator.request(ENABLE)
    operator.stop()
    b.steps(20)
    assert b.drives[0].state != 4


@pytest.mark.parametrize("mode", [CSP, CSV, PV])
def test_an_operator_disables_and_enables(mode: int) -> None:
    b, operator = made(mode)
    operator.request(DISABLE)
    b.steps(5)
    assert operator.taken() is RequestStatus.TAKEN
    assert b.drives[0].state != 4
    operator.request(ENABLE)
    b.steps(12)
    assert operator.taken() is RequestStatus.TAKEN
    assert b.axis_flags[0] & AXIS_FOLLOWED
    assert b.drives[0].state == 4


def test_an_operator_does_not_enable_torque_control() -> None:
    b, operator = made(CST)
    operator.request(DISABLE)
    b.steps(5)
    operator.request(ENABLE)
    b.steps(12)
    assert operator.taken() is RequestStatus.REFUSED_MODE
    assert b.drives[0].state != 4


@pytest.mark.parametrize("state", [ENABLE, RESET])
def test_without_permission_an_operator_gives_no_power(state: int) -> None:
    b, operator = made(jog=False)
    operator.request(DISABLE)
    b.steps(5)
    assert operator.taken() is RequestStatus.TAKEN
    operator.request(state)
    b.steps(12)
    assert operator.taken() is RequestStatus.REFUSED_NOT_ALLOWED
    assert b.drives[0].state != 4


def test_in_a_hand_over_an_operator_enables_nothing() -> None:
    b, operator = made()
    operator.request(DISABLE)
    b.steps(5)
    operator.request(ENABLE)
    b.engine.run(20)  # as while a loop is left
    assert operator.taken() is RequestStatus.REFUSED_HANDOVER
    b.steps(20)
    assert b.drives[0].state != 4


def test_a_reset_of_an_axis_without_a_fault_changes_nothing() -> None:
    b, operator = made()
    operator.request(RESET)
    b.steps(5)
    assert operator.taken() is RequestStatus.TAKEN
    assert b.drives[0].state == 4


def test_a_velocity_axis_without_an_actual_position_can_be_jogged() -> None:
    b, operator = made(CSV, actual_position=None, target_position=None)
    operator.press(0.5)
    jogged(b, operator, 100)
    assert velocity_of(b) == 0.5


def test_an_operator_resets_a_fault_without_motion() -> None:
    b, operator = made()
    b.drives[0].state = 7
    b.steps(5)
    operator.request(RESET)
    b.steps(10)
    assert b.drives[0].state not in (4, 7)


def test_a_quick_stop_of_one_axis_names_the_operator() -> None:
    b, operator = made()
    operator.request(QUICK_STOP)
    b.steps(3)
    assert StopReason(b.stop_reason[0]) is StopReason.OPERATOR
    assert b.drives[0].state != 4


def test_the_later_request_of_the_application_wins() -> None:
    b, operator = made()
    operator.request(DISABLE)
    b.steps(5)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.drives[0].state == 4


# ---- hostile words


@settings(max_examples=200, deadline=None)
@given(
    written=st.lists(
        st.tuples(
            st.integers(0, 31),
            st.one_of(
                st.integers(0, 2**64 - 1),
                st.sampled_from([0, 1, 2, 2**63, 2**64 - 1]),
                st.floats(-2.0, 2.0).map(lambda v: int(np.float64(v).view(np.uint64))),
            ),
        ),
        max_size=20,
    )
)
def test_no_content_of_the_words_moves_the_axis_beyond_its_limits(
    written: list[tuple[int, int]],
) -> None:
    limits = AxisLimits(velocity=V, position_min=-0.05, position_max=0.05)
    b, operator = made(limits=limits)
    words = operator.bytes.view(np.uint64)
    operator.press(0.5)
    path = [0.0]
    for word, value in written:
        words[word] = value
        b.engine.next()
        b.engine.next()
        path.append(commanded(b) if b.drives[0].state == 4 else path[-1])
    b.steps(300)
    assert np.isfinite(path).all()
    assert max(map(abs, path)) <= 0.05 + 1e-9
    assert max(abs(after - before) for before, after in pairwise([0.0, *path])) <= 2 * V * T + 1e-9
    assert b.jogged[0] == 0


def test_words_of_another_number_of_axes_are_refused() -> None:
    b = bench(axis(0))
    operator = Operator(b)
    operator.table.motion_axes = 2
    with pytest.raises(ValueError, match="motion words of 2 axes, the engine has 1"):
        operator.attach()
