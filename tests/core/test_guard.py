"""Safety in the step: every rule of docs/explanation/safety.md, "In the core"."""

import math
from itertools import pairwise

import numpy as np
import pytest

from catenary.core import (
    AXIS_DROPPED,
    AXIS_FALLBACK,
    AXIS_FOLLOWED,
    AXIS_LIMITED,
    AXIS_REFUSED,
    CYCLE_DROPPED,
    CYCLE_LIMITED,
    CYCLE_REFUSED,
    CYCLE_UNCOMMITTED,
    REQUEST_DISABLED,
    REQUEST_ENABLED,
    REQUEST_QUICK_STOP,
    REQUEST_RESET,
)
from catenary.plan.cycle import AxisLimits, SyncUnit
from catenary.plan.stop_reason import StopReason
from tests.core.rig import CSP, CST, CSV, MS, Bench, ScriptedDrive, axis, bench

EXECUTION_MODES = ("threaded", "inline")
OE, QUICK_STOPPED, FAULT = 4, 5, 7


def goal_in_force(b: Bench) -> int:
    return int(b.axis_flags[0]) >> 6


def followed(b: Bench) -> bool:
    return bool(b.axis_flags[0] & AXIS_FOLLOWED)


def dropped(b: Bench) -> bool:
    return bool(b.axis_flags[0] & AXIS_DROPPED)


def driving(mode: int, *, execution: str = "threaded", **more: object) -> Bench:
    """One axis, enabled and followed by an application that has committed once."""
    b = bench(axis(0, mode=mode, **more), execution=execution)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert followed(b)
    return b


# ---- enabling


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_until_it_is_followed_the_target_is_the_actual_position(execution: str) -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=1234, moves=False)], execution=execution)
    b.ask(REQUEST_ENABLED)
    for _ in range(10):
        b.target_position[0] = 99.0  # committed before anyone could see that it is followed
        b.engine.next()
        assert b.drives[0].target_position in (0, 1234)  # 0: nothing was received yet
        if followed(b):
            break
    b.engine.next()
    assert b.drives[0].target_position == 1234
    b.target_position[0] = 2.0
    b.engine.next()
    b.engine.next()
    assert b.drives[0].target_position == 2000


def test_a_target_counts_only_when_its_writer_had_seen_that_it_is_followed() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=500, moves=False)])
    b.ask(REQUEST_ENABLED)
    b.engine.next()
    b.target_position[0] = 99.0
    b.engine.spend(20 * MS)  # it gets enabled meanwhile
    b.engine.next()  # this commit was written before
    assert followed(b)
    assert b.drives[0].target_position == 500


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_run_holds_and_hands_the_held_position_over(execution: str) -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=700)], execution=execution)
    b.enable()
    b.target_position[0] = 5.0
    b.engine.run(3)
    assert b.drives[0].target_position == 700
    assert b.target_position[0] == pytest.approx(0.7)
    b.engine.next()
    assert b.drives[0].target_position == 700


@pytest.mark.parametrize("mode", [CSV, CST])
def test_velocity_and_torque_enable_at_the_first_committed_target(mode: int) -> None:
    b = bench(axis(0, mode=mode))
    b.ask(REQUEST_ENABLED)
    b.engine.run(20)
    assert b.drives[0].state == 1
    b.steps(5)
    assert followed(b)


def test_a_torque_is_there_when_the_brake_opens() -> None:
    b = bench(axis(0, mode=CST))
    b.ask(REQUEST_ENABLED)
    seen = {}
    for _ in range(8):
        b.target_torque[0] = 0.5
        b.engine.next()
        seen.setdefault(b.drives[0].state, b.drives[0].target_torque)
    assert seen == {1: 0, 2: 0, 3: 0, OE: 500}


def test_no_velocity_before_it_is_followed() -> None:
    b = bench(axis(0, mode=CSV), drives=[ScriptedDrive(follows=False)])
    b.ask(REQUEST_ENABLED)
    for _ in range(10):
        b.target_velocity[0] = 1.0
        b.engine.next()
    assert b.drives[0].state == OE
    assert b.drives[0].target_velocity == 0


def test_the_torque_stays_while_an_open_brake_waits_for_bit_12() -> None:
    b = bench(axis(0, mode=CST), drives=[ScriptedDrive(follows=False)])
    b.ask(REQUEST_ENABLED)
    sent = []
    for _ in range(20):
        b.target_torque[0] = 1.0
        b.engine.next()
        if b.drives[0].state == OE:
            sent.append(b.drives[0].target_torque)
    assert not followed(b)
    assert set(sent) == {1000}  # 0 N·m would drop a load


@pytest.mark.parametrize("drive", [ScriptedDrive(follows=False), ScriptedDrive(mode_shown=1)])
def test_bit_12_and_the_mode_shown_are_needed(drive: ScriptedDrive) -> None:
    drive.moves = False
    b = bench(axis(0), drives=[drive])
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert b.drives[0].state == OE
    assert not followed(b)
    drive.follows, drive.mode_shown = True, None
    b.steps(2)
    assert followed(b)


def mute_drive() -> Bench:
    """In the second after OPERATION_ENABLED its drive has not shown bit 12 (as KickCAT's)."""
    b = bench(axis(0), drives=[ScriptedDrive(position=300, follows=False)])
    b.ask(REQUEST_ENABLED)
    b.steps(900)
    assert not followed(b)
    b.steps(200)
    return b


def test_a_drive_that_never_shows_bit_12_is_followed_after_a_second() -> None:
    b = mute_drive()
    assert followed(b)
    assert b.drives[0].target_position == 300
    b.target_position[0] = 2.0
    b.steps(2)
    assert b.drives[0].target_position == 2000


def test_a_drive_that_is_known_to_lack_bit_12_need_not_be_waited_for_again() -> None:
    b = mute_drive()
    b.ask(REQUEST_DISABLED)
    b.steps(20)
    assert not followed(b)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert followed(b)


def test_a_late_bit_12_drops_the_requested_state_once() -> None:
    b = mute_drive()
    b.drives[0].follows = True
    b.steps(2)
    assert dropped(b)
    assert not followed(b)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert followed(b)
    b.drives[0].follows = False
    b.steps(5)
    assert not followed(b)  # it has the bit: without it nothing counts


def test_a_mode_may_change_while_running() -> None:
    b = driving(CSP)
    b.target_position[0] = 0.3
    b.engine.next()
    b.mode_target[0] = CSV
    b.drives[0].mode_shown = CSP
    b.target_velocity[0] = 0.8
    b.steps(2)
    assert not followed(b)
    assert b.drives[0].mode == CSV
    assert b.drives[0].target_velocity == 0
    b.drives[0].mode_shown = None
    b.engine.next()
    b.target_velocity[0] = 0.8
    b.engine.next()
    assert b.drives[0].target_velocity == 800


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_change_of_mode_does_not_send_the_position_written_long_ago(execution: str) -> None:
    b = driving(CSV, execution=execution)
    b.target_position[0] = 5.0  # nobody follows it
    b.steps(2)
    sent = []
    exchange = b.drives[0].exchange

    def watched(outputs: bytes) -> bytes:
        answer = exchange(outputs)
        sent.append((b.drives[0].mode, b.drives[0].target_position))
        return answer

    b.drives[0].exchange = watched  # type: ignore[method-assign]
    b.mode_target[0] = CSP
    b.steps(3)
    assert sent[-1][0] == CSP
    assert {position for _, position in sent} == {0}


def test_a_mode_without_its_target_mapped_is_never_followed() -> None:
    b = bench(axis(0, mode=CST, target_torque=None))
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert b.drives[0].state == OE
    assert not followed(b)


def test_a_request_that_is_not_fulfilled_lapses() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(state=0)], late_limit_position_ns=0)
    b.drives[0].after = lambda before: 0  # type: ignore[method-assign]
    b.ask(REQUEST_ENABLED)
    b.engine.run(9_000)
    assert goal_in_force(b) == REQUEST_ENABLED
    b.engine.run(1_100)
    assert goal_in_force(b) == REQUEST_DISABLED
    assert dropped(b)


# ---- goals that drop


@pytest.mark.parametrize("state", [1, QUICK_STOPPED, 6, FAULT, 3])
def test_what_leaves_operation_by_itself_needs_a_new_request(state: int) -> None:
    b = driving(CSP)
    b.drives[0].state = state
    b.drives[0].after = lambda before: state  # type: ignore[method-assign]
    flags = b.engine.next()
    assert flags & CYCLE_DROPPED
    assert goal_in_force(b) == REQUEST_DISABLED
    assert dropped(b)
    del b.drives[0].after  # it could move on
    b.drives[0].state = 1
    b.steps(20)
    assert b.drives[0].state in (1, 2)  # disabled
    b.requested_state[0] = REQUEST_ENABLED  # the same requested_state without a new request
    b.steps(20)
    assert b.drives[0].state in (1, 2)
    b.ask(REQUEST_ENABLED)
    b.steps(8)
    assert followed(b)
    assert not dropped(b)


def test_a_fault_is_reset_by_a_new_request_only() -> None:
    b = driving(CSP)
    b.drives[0].state = FAULT
    b.steps(20)
    assert b.drives[0].state == FAULT
    assert not b.drives[0].controlword & 0x80
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert followed(b)


@pytest.mark.parametrize("requested_state", [REQUEST_ENABLED, REQUEST_RESET])
def test_a_request_in_every_cycle_resets_a_fault(requested_state: int) -> None:
    b = driving(CSP)
    b.drives[0].state = FAULT
    b.steps(2)
    for _ in range(10):
        b.ask(requested_state)
        b.steps(1)
    assert b.drives[0].state != FAULT


def test_a_reset_acknowledges_without_enabling() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(state=FAULT)])
    b.engine.run(2)
    b.ask(REQUEST_RESET)
    b.engine.run(10)
    assert b.drives[0].state == 1
    assert goal_in_force(b) == REQUEST_DISABLED


def test_every_request_makes_an_edge_of_its_own() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(state=FAULT)])
    words: list[int] = []

    def stubborn(before: int) -> int:
        words.append(b.drives[0].controlword)
        return FAULT

    b.drives[0].after = stubborn  # type: ignore[method-assign]
    for _ in range(3):
        b.ask(REQUEST_RESET)
        b.engine.run(4)
    edges = sum(a & 0x80 == 0 and c & 0x80 != 0 for a, c in pairwise(words))
    assert edges == 3


def test_an_axis_that_dropped_while_the_drive_stays_enabled_is_stopped_quickly() -> None:
    b = bench(axis(0), sync_units=(SyncUnit("u", (0,), optional=True),), lost_limit=3)
    b.enable()
    b.segment.silent = {0}
    b.steps(2)
    assert followed(b)  # less than lost_limit: bridged
    b.segment.silent = set()
    b.steps(2)
    assert followed(b)
    b.segment.silent = {0}
    b.steps(3)
    assert not followed(b)
    assert dropped(b)
    b.segment.silent = set()
    b.engine.next()
    assert b.drives[0].state in (QUICK_STOPPED, 1)
    b.steps(20)
    assert b.drives[0].state == 1


def test_a_request_to_a_lost_device_is_discarded() -> None:
    b = bench(axis(0), sync_units=(SyncUnit("u", (0,), optional=True),))
    b.engine.run(1)
    b.segment.silent = {0}
    b.engine.run(5)
    b.ask(REQUEST_ENABLED)
    b.engine.run(5)
    assert dropped(b)
    b.segment.silent = set()
    b.engine.run(20)
    assert b.drives[0].state == 1


# ---- stopping


def test_quick_stop_removes_the_voltage_only_at_standstill() -> None:
    b = driving(CSP)
    b.drives[0].stays_in_quick_stop = True
    b.drives[0].velocity = 900
    b.steps(2)
    b.ask(REQUEST_QUICK_STOP)
    b.steps(30)
    assert b.drives[0].state == QUICK_STOPPED
    b.drives[0].velocity = 0
    b.steps(10)
    assert b.drives[0].state == 1
    assert goal_in_force(b) == REQUEST_DISABLED


@pytest.mark.parametrize("requested_state", [REQUEST_ENABLED, REQUEST_RESET])
def test_a_request_during_a_quick_stop_waits_for_standstill(requested_state: int) -> None:
    b = driving(CSP)
    b.drives[0].stays_in_quick_stop = True
    b.drives[0].velocity = 900
    b.steps(2)
    b.ask(REQUEST_QUICK_STOP)
    b.steps(5)
    b.ask(requested_state)
    b.steps(30)
    assert b.drives[0].state == QUICK_STOPPED
    b.drives[0].velocity = 0
    b.steps(20)
    assert b.drives[0].state == (OE if requested_state == REQUEST_ENABLED else 1)


def test_disabling_uses_disable_operation() -> None:
    b = driving(CSP)
    b.ask(REQUEST_DISABLED)
    b.engine.next()
    assert b.drives[0].controlword & 0x0F == 0x07
    b.steps(5)
    assert b.drives[0].state == 2


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_quick_stop_all_and_the_native_end(execution: str) -> None:
    b = bench(axis(0), axis(1), execution=execution)
    b.enable()
    b.steps(3)
    for drive in b.drives:
        drive.stays_in_quick_stop = True
        drive.velocity = 400
    b.steps(1)
    b.engine.quick_stop_all()
    assert not b.engine.run_until_stopped(30 * MS)
    assert [d.state for d in b.drives] == [QUICK_STOPPED] * 2
    for drive in b.drives:
        drive.velocity = 0
    assert b.engine.run_until_stopped(100 * MS)
    assert [d.state for d in b.drives] == [1, 1]
    b.engine.run(20)
    assert [d.state for d in b.drives] == [1, 1]


def test_quick_stop_all_overrides_a_request_of_the_same_commit() -> None:
    b = driving(CSP)
    b.ask(REQUEST_ENABLED)
    b.engine.quick_stop_all()
    b.steps(20)
    assert b.drives[0].state == 1


# ---- late Python


def test_late_python_holds_a_position_and_stops_after_50_ms() -> None:
    b = driving(CSP)
    b.target_position[0] = 0.4
    b.engine.next()
    b.engine.spend(40 * MS)
    flags = b.engine.next()
    assert followed(b)
    assert b.drives[0].target_position == 400
    assert not flags & CYCLE_UNCOMMITTED
    b.engine.spend(60 * MS)
    assert b.drives[0].state == 1
    b.steps(10)
    assert dropped(b)
    assert b.drives[0].state == 1
    assert b.engine.counters["uncommitted"] == 100


def noting(b: Bench, quantity: str) -> list[int]:
    """Note what the drive receives in every cycle."""
    sent: list[int] = []
    exchange = b.drives[0].exchange

    def note(outputs: bytes) -> bytes:
        inputs = exchange(outputs)
        sent.append(getattr(b.drives[0], quantity))
        return inputs

    b.drives[0].exchange = note  # type: ignore[method-assign]
    return sent


def test_late_python_decelerates_a_velocity_and_returns_within_the_acceleration() -> None:
    b = driving(CSV, deceleration=100.0, acceleration=200.0)  # 0.1 and 0.2 rad/s a cycle
    b.target_velocity[0] = 1.0
    b.engine.next()
    sent = noting(b, "target_velocity")
    b.engine.spend(5 * MS)
    assert sent == [900, 800, 700, 600, 500]
    assert b.drives[0].state == OE
    b.steps(4)
    assert sent[5:] == [700, 900, 1000, 1000]
    b.engine.spend(52 * MS)
    b.steps(3)
    assert dropped(b)
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert b.drives[0].state == 1


def test_late_python_keeps_a_torque_until_the_drive_has_left_operation_enabled() -> None:
    b = driving(CST)
    b.target_torque[0] = 0.5
    b.engine.next()
    sent = noting(b, "target_torque")
    b.engine.spend(9 * MS)
    assert sent == [500] * 9
    assert b.drives[0].state == OE
    b.engine.next()
    assert followed(b)
    sent.clear()
    b.engine.spend(10 * MS)
    assert sent == [500] * 10  # the last frame carries the quick stop
    assert b.drives[0].state != OE
    b.steps(3)
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert b.drives[0].state == 1
    assert b.drives[0].target_torque == 0


def test_a_torque_returns_within_its_slope() -> None:
    b = driving(CST, torque_slope=100.0)  # 0.1 N·m a cycle
    b.target_torque[0] = 0.5
    b.engine.next()
    sent = noting(b, "target_torque")
    b.engine.spend(2 * MS)
    b.target_torque[0] = 0.8
    b.steps(5)
    assert sent == [500, 500, 600, 700, 800, 800, 800]


def test_a_late_limit_of_zero_is_off() -> None:
    b = bench(axis(0), late_limit_position_ns=0)
    b.enable()
    b.engine.next()
    b.engine.spend(5_000 * MS)
    b.engine.next()
    assert followed(b)


def test_no_axis_is_late_before_and_between_applications() -> None:
    b = bench(axis(0))
    b.enable()
    b.engine.spend(500 * MS)
    b.engine.run(500)
    b.steps(2)
    b.engine.run(500)
    assert followed(b)
    assert b.engine.counters["uncommitted"] == 0


# ---- targets that are no numbers


@pytest.mark.parametrize("execution", EXECUTION_MODES)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_no_number_is_refused(execution: str, value: float) -> None:
    b = driving(CSP, execution=execution)
    b.target_position[0] = 0.25
    b.steps(2)
    b.target_position[0] = value
    flags = b.steps(2)
    assert flags & CYCLE_REFUSED
    assert b.axis_flags[0] & AXIS_REFUSED
    assert b.drives[0].target_position == 250
    b.target_position[0] = 0.26
    b.steps(60)
    assert not b.axis_flags[0] & (AXIS_REFUSED | AXIS_FALLBACK)
    assert b.drives[0].target_position == 260


def test_refused_for_too_long_is_a_quick_stop() -> None:
    b = driving(CSV, deceleration=100.0)
    b.target_velocity[0] = 1.0
    b.engine.next()
    b.target_velocity[0] = np.nan
    b.steps(3)
    assert b.drives[0].target_velocity == 700
    b.steps(55)
    assert dropped(b)
    assert b.stop_reason[0] == StopReason.REFUSED
    assert b.drives[0].state == 1


# ---- limits


@pytest.mark.parametrize("execution", EXECUTION_MODES)
def test_a_position_is_clamped_and_so_is_its_step(execution: str) -> None:
    # 0.1 rad a cycle
    limits = AxisLimits(position_min=-0.5, position_max=0.5, velocity=100.0, step=20.0)
    b = driving(CSP, execution=execution, limits=limits)
    b.target_position[0] = 3.0
    steps = []
    for _ in range(8):
        flags = b.engine.next()
        assert flags & CYCLE_LIMITED
        steps.append(b.drives[0].target_position)
    assert steps == [100, 200, 300, 400, 500, 500, 500, 500]
    assert b.axis_flags[0] & AXIS_LIMITED
    b.target_position[0] = 0.45
    flags = b.steps(2)
    assert not flags & CYCLE_LIMITED
    b.target_position[0] = -9.0
    b.steps(20)
    assert b.drives[0].target_position == -500


def test_an_axis_outside_its_limits_holds_and_may_only_come_back() -> None:
    limits = AxisLimits(position_max=0.5)
    b = bench(axis(0, limits=limits), drives=[ScriptedDrive(position=800)])
    b.enable()
    assert b.drives[0].target_position == 800
    b.target_position[0] = 0.9
    b.engine.next()
    assert b.drives[0].target_position == 800
    b.target_position[0] = 0.7
    b.engine.next()
    assert b.drives[0].target_position == 700
    b.target_position[0] = 0.75
    b.engine.next()
    assert b.drives[0].target_position == 700


def test_velocity_and_torque_are_clamped() -> None:
    limits = AxisLimits(velocity=2.0, torque=1.5)
    b = driving(CSV, limits=limits)
    for asked, sent in ((5.0, 2000), (-5.0, -2000), (1.0, 1000)):
        b.target_velocity[0] = asked
        flags = b.engine.next()
        assert b.drives[0].target_velocity == sent
        assert bool(flags & CYCLE_LIMITED) == (abs(asked) > 2)
    b = driving(CST, limits=limits)
    for asked, sent in ((5.0, 1500), (-5.0, -1500), (1.0, 1000)):
        b.target_torque[0] = asked
        b.engine.next()
        assert b.drives[0].target_torque == sent


def test_a_velocity_stops_at_the_position_limit() -> None:
    b = driving(CSV, limits=AxisLimits(position_max=1.0, velocity=5.0), deceleration=50.0)
    drive = b.drives[0]
    for _ in range(2000):
        b.target_velocity[0] = 5.0
        flags = b.engine.next()
        drive.velocity = drive.target_velocity
        drive.position += drive.velocity // 1000
    assert 900 < drive.position <= 1000
    assert followed(b)
    assert flags & CYCLE_LIMITED
    b.target_velocity[0] = -1.0
    b.engine.next()
    assert drive.target_velocity == -1000


def test_a_velocity_axis_that_leaves_its_limits_all_the_same_is_stopped() -> None:
    b = driving(CSV, limits=AxisLimits(position_min=-1.0, velocity=5.0))
    b.drives[0].position = -1200
    b.drives[0].velocity = -700
    b.steps(30)
    assert dropped(b)
    assert b.drives[0].state != OE


def test_no_torque_towards_a_limit_and_quick_stop_beyond() -> None:
    b = driving(CST, limits=AxisLimits(position_max=1.0))
    drive = b.drives[0]
    drive.position = 1000
    for asked, sent in ((0.5, 0), (-0.5, -500)):
        b.target_torque[0] = asked
        b.steps(2)
        assert drive.target_torque == sent
    assert followed(b)
    drive.position, drive.velocity = 1001, 400
    b.steps(4)
    assert dropped(b)
    assert drive.state != OE


def test_no_torque_that_would_exceed_the_velocity_limit() -> None:
    b = driving(CST, limits=AxisLimits(velocity=1.0))
    drive = b.drives[0]
    drive.velocity = 1100
    for asked, sent in ((0.5, 0), (-0.5, -500)):
        b.target_torque[0] = asked
        b.steps(2)
        assert drive.target_torque == sent


def test_a_torque_beyond_its_type_is_saturated_and_reported() -> None:
    b = driving(CST)
    b.target_torque[0] = 100.0  # 100 000 counts in 16 bits
    assert b.engine.next() & CYCLE_LIMITED
    assert b.drives[0].target_torque == 2**15 - 1


@pytest.mark.parametrize(
    "limits",
    [
        AxisLimits(position_min=1.0, position_max=1.0),
        AxisLimits(position_max=math.nan),
        AxisLimits(velocity=0.0),
        AxisLimits(torque=-1.0),
        AxisLimits(velocity=math.inf),
    ],
)
def test_limits_that_cannot_be(limits: AxisLimits) -> None:
    with pytest.raises(ValueError, match="axis 0"):
        bench(axis(0, limits=limits))
