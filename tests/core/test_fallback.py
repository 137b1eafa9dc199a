"""Fallback, return, mode changes and stops of one axis: docs/explanation/safety.md, in the core."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.core import (
    AXIS_FALLBACK,
    AXIS_MODE_REFUSED,
    CYCLE_DROPPED,
    CYCLE_REFUSED,
    REQUEST_DISABLED,
    REQUEST_ENABLED,
    REQUEST_QUICK_STOP,
    Stream,
)
from catenary.plan.cycle import AxisLimits, SyncUnit
from catenary.plan.stop_reason import StopReason
from tests.core.rig import (
    COUNTS,
    CSP,
    CST,
    CSV,
    MS,
    NM,
    PERIOD,
    Bench,
    ScriptedDrive,
    al_status,
    axis,
    bench,
    column,
    frame_plan,
    lrw,
    number,
)

OE = 4
ENABLE, QUICK_STOP, DISABLE_OPERATION, DISABLE_VOLTAGE = 0x0F, 0x02, 0x07, 0x00


class Recorder:
    """Note what the first drive receives in every cycle."""

    def __init__(self, b: Bench) -> None:
        self.words: list[int] = []
        self.modes: list[int] = []
        self.positions: list[int] = []
        self.velocities: list[int] = []
        self.torques: list[int] = []
        drive = b.drives[0]
        exchange = drive.exchange

        def note(outputs: bytes) -> bytes:
            inputs = exchange(outputs)
            self.words.append(drive.controlword)
            self.modes.append(drive.mode)
            self.positions.append(drive.target_position)
            self.velocities.append(drive.target_velocity)
            self.torques.append(drive.target_torque)
            return inputs

        drive.exchange = note  # type: ignore[method-assign]


def working(mode: int, *, drive: ScriptedDrive | None = None, **more: object) -> Bench:
    """One axis that follows the committed set-points."""
    cycle = {k: more.pop(k) for k in ("input_columns", "output_columns") if k in more}
    b = bench(axis(0, mode=mode, **more), drives=[drive or ScriptedDrive()], **cycle)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.axis_flags[0] & 1
    return b


def moving(b: Bench, velocity: float, cycles: int = 20) -> None:
    """Move the set-point at a constant velocity [rad/s]."""
    for _ in range(cycles):
        b.target_position[0] += velocity * PERIOD * 1e-9
        b.engine.next()


# ---- CSP without fresh set-points


def test_an_underrun_keeps_the_velocity_for_10_ms_then_decelerates() -> None:
    b = working(CSP, deceleration=100.0)
    moving(b, 2.0)
    log = Recorder(b)
    b.engine.spend(45 * MS)
    speeds = np.diff(log.positions)
    assert list(speeds[:9]) == [2] * 9
    assert np.abs(np.diff(speeds)).max() <= 1
    assert speeds[-1] == 0
    assert 2 * 10 + 20 - 2 <= log.positions[-1] - log.positions[0] + 2 <= 2 * 10 + 20 + 2
    assert b.drives[0].state == OE


def test_after_the_late_limit_the_axis_stops_with_a_reason() -> None:
    b = working(CSP)
    moving(b, 2.0)
    b.engine.spend(60 * MS)
    flags = b.engine.next()
    assert flags & CYCLE_DROPPED
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert 0 < b.engine.number - b.stop_cycle[0] < 15
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.stop_reason[0] == StopReason.NONE


@pytest.mark.parametrize("pause", [1, 2, 5, 12, 30])
def test_the_command_returns_to_the_set_points_without_a_jump(pause: int) -> None:
    """The application goes on as if it had not been late: its trajectory moved on."""
    limits = AxisLimits(velocity=20.0, step=10.0)
    b = working(CSP, acceleration=50.0, deceleration=50.0, limits=limits)
    moving(b, 2.0, 50)
    log = Recorder(b)
    b.engine.spend(pause * MS)
    moving(b, 2.0, 1)
    b.target_position[0] += 2.0e-3 * pause
    moving(b, 2.0, 400)
    speeds = np.diff(log.positions)
    assert np.abs(np.diff(speeds)).max() <= (1 if pause < 10 else 2)  # 50 rad/s², and rounding
    assert log.positions[-1] == pytest.approx(round(b.target_position[0] * COUNTS), abs=1)
    assert not b.axis_flags[0] & AXIS_FALLBACK


def test_an_application_that_commits_every_second_cycle_moves_smoothly() -> None:
    b = working(CSP)
    moving(b, 2.0)
    log = Recorder(b)
    b.target_position[0] -= 2.0e-3
    for _ in range(50):
        b.target_position[0] += 4.0e-3
        b.engine.spend(1 * MS)
        b.engine.next()
    assert set(np.diff(log.positions)[2:]) == {2}


def test_a_single_step_is_not_a_velocity() -> None:
    b = working(CSP, limits=AxisLimits(velocity=6.28))
    b.target_position[0] += 0.05
    b.engine.next()
    b.engine.spend(30 * MS)
    assert b.drives[0].target_position == 50


def test_extrapolation_stops_before_a_position_limit() -> None:
    b = working(CSP, deceleration=100.0, limits=AxisLimits(position_max=0.1))
    moving(b, 2.0, 45)
    assert b.drives[0].target_position >= 88
    b.engine.spend(40 * MS)
    assert b.drives[0].target_position <= 100


@pytest.mark.parametrize("pause", [10, 20, 40])
@pytest.mark.parametrize("acceleration", [5.0, 50.0])
def test_the_return_to_set_points_does_not_exceed_a_position_limit(
    pause: int, acceleration: float
) -> None:
    """The set-points reach the limit and stop while the command still catches up."""
    limits = AxisLimits(velocity=20.0, step=10.0, position_max=0.12, position_min=-0.12)
    b = working(CSP, acceleration=acceleration, deceleration=acceleration, limits=limits)
    for end in (0.12, -0.12):
        while abs(b.target_position[0]) < 0.09 or b.target_position[0] * end < 0:
            b.target_position[0] += np.sign(end) * 2e-3
            b.engine.next()
        log = Recorder(b)
        b.engine.spend(pause * MS)
        for _ in range(400):
            b.target_position[0] = np.clip(b.target_position[0] + end / 60, -0.12, 0.12)
            b.engine.next()
        assert max(np.abs(log.positions)) <= 120
        assert log.positions[-1] == round(end * COUNTS)
        assert not b.axis_flags[0] & AXIS_FALLBACK


def test_a_return_to_set_points_beyond_a_limit_ends_at_the_limit() -> None:
    limits = AxisLimits(velocity=20.0, step=10.0, position_max=0.12)
    b = working(CSP, acceleration=50.0, deceleration=50.0, limits=limits)
    moving(b, 2.0, 40)
    log = Recorder(b)
    b.engine.spend(20 * MS)
    moving(b, 2.0, 300)
    assert max(log.positions) <= 120
    assert log.positions[-1] == 120
    assert not b.axis_flags[0] & AXIS_FALLBACK


def test_a_hand_over_decelerates_at_once_and_holds_without_limit() -> None:
    b = working(CSP, deceleration=100.0)
    moving(b, 2.0)
    log = Recorder(b)
    b.engine.run(500)
    assert log.positions[-1] - log.positions[0] == pytest.approx(20 - 2, abs=2)
    assert b.axis_flags[0] & 1


def test_0x60b1_follows_the_fallback_velocity() -> None:
    at = number(11, 16, scale=1e-3)  # in the place of the target torque
    b = working(
        CSP,
        deceleration=100.0,
        target_torque=None,
        velocity_offset=at,
        output_columns=(column("offset", at, 0),),
    )
    for _ in range(20):
        b.target_position[0] += 2e-3
        b.output_reals[0] = 2.0
        b.engine.next()
    log = Recorder(b)
    b.engine.spend(40 * MS)
    assert log.torques[:10] == [2000] * 10
    assert log.torques[15] == pytest.approx(1400, abs=101)
    assert log.torques[-1] == 0


# ---- set-points that are refused


def test_a_step_beyond_the_limit_is_refused_and_stops_the_axis_in_time() -> None:
    b = working(CSP, limits=AxisLimits(velocity=6.28))
    b.target_position[0] += 3.0
    flags = b.steps(2)
    assert flags & CYCLE_REFUSED
    assert b.drives[0].target_position == 0
    b.steps(60)
    assert b.stop_reason[0] == StopReason.REFUSED
    assert b.drives[0].target_position == 0


def test_the_step_limit_is_an_option_and_grows_with_the_time_between() -> None:
    b = working(CSP, limits=AxisLimits(velocity=6.28, step=4.0))
    b.target_position[0] += 3.0
    assert not b.steps(2) & CYCLE_REFUSED
    b = working(CSP, limits=AxisLimits(velocity=6.28))
    b.engine.run(300)  # 2 · 6.28 rad/s · 0.3 s
    b.target_position[0] += 3.0
    assert not b.engine.next() & CYCLE_REFUSED


# ---- CST in a hand-over


def test_cst_keeps_its_torque_for_the_hand_over_and_stops() -> None:
    b = working(CST)
    b.target_torque[0] = 0.5
    b.engine.next()
    log = Recorder(b)
    b.engine.run(20)
    assert log.torques == [500] * 20
    assert set(log.words) == {ENABLE}
    b.engine.run(20)
    assert b.stop_reason[0] == StopReason.HANDOVER
    stop = log.words.index(QUICK_STOP)
    assert log.torques[stop] == 500  # never 0 N·m in the frame of the quick stop
    assert log.torques[-1] == 0


def streamed(mode: int) -> tuple[Bench, Stream]:
    """One axis that follows rows of a stream: 0.5 N·m, or a position that moves at 2 rad/s."""
    b = working(mode, deceleration=100.0)
    stream = Stream(1, 20)
    b.engine.set_stream(stream)
    rows = np.array([[0.002 * k, 0.0, 0.5] for k in range(1, 11)])
    stream.write(rows.tobytes(), b.engine.number)
    b.steps(10)
    return b, stream


def test_closing_a_stream_is_a_hand_over_until_the_next_commit() -> None:
    b, _ = streamed(CST)
    log = Recorder(b)
    b.engine.set_stream(None)
    b.engine.spend(20 * MS)
    assert log.torques == [500] * 20
    assert set(log.words) == {ENABLE}
    b.engine.spend(5 * MS)
    b.engine.next()
    assert b.stop_reason[0] == StopReason.HANDOVER


def test_a_commit_in_time_ends_the_hand_over_of_a_stream() -> None:
    b, _ = streamed(CST)
    b.engine.set_stream(None)
    b.engine.spend(15 * MS)
    b.target_torque[0] = 0.4
    b.steps(30)
    assert b.axis_flags[0] & 1
    b.engine.spend(15 * MS)
    b.engine.next()
    assert b.stop_reason[0] == StopReason.UNDERRUN


def test_a_closed_stream_decelerates_at_once_and_holds_without_limit() -> None:
    b, _ = streamed(CSP)
    log = Recorder(b)
    b.engine.set_stream(None)
    b.engine.spend(500 * MS)
    assert log.positions[-1] - log.positions[0] == pytest.approx(20 - 2, abs=2)
    assert b.axis_flags[0] & 1


def test_an_empty_stream_is_an_underrun() -> None:
    b, _ = streamed(CST)
    b.engine.spend(12 * MS)
    b.engine.next()
    assert b.stop_reason[0] == StopReason.UNDERRUN


# ---- enabling and bit 12


def test_the_command_is_frozen_where_operation_enabled_was_reached() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=500, follows=False, moves=False)])
    b.ask(REQUEST_ENABLED)
    log = Recorder(b)
    for _ in range(300):
        b.engine.run(1)
        if b.drives[0].state == OE:
            b.drives[0].position -= 1  # it sags
    assert set(log.positions[10:]) == {500}


def test_up_to_three_cycles_without_bit_12_are_bridged() -> None:
    b = working(CSP)
    moving(b, 2.0)
    log = Recorder(b)
    b.drives[0].follows = False
    moving(b, 2.0, 3)
    b.drives[0].follows = True
    moving(b, 2.0, 10)
    assert set(np.diff(log.positions)) == {2}
    assert b.axis_flags[0] & 1


def test_a_longer_loss_of_bit_12_commands_the_demand_and_returns() -> None:
    demand = number(3, 32, scale=1 / COUNTS)  # in the place of the actual velocity
    drive = ScriptedDrive()
    b = working(CSP, drive=drive, actual_velocity=None, position_demand=demand, acceleration=50.0)
    moving(b, 2.0)
    log = Recorder(b)
    drive.follows, drive.moves = False, False
    drive.velocity = stood = drive.position - 3  # 0x6062: where its own command stands
    moving(b, 2.0, 8)
    assert log.positions[-1] == stood
    drive.follows = drive.moves = True
    moving(b, 2.0, 400)
    assert np.abs(np.diff(np.diff(log.positions[10:]))).max() <= 2  # 50 rad/s², and rounding
    assert log.positions[-1] == pytest.approx(round(b.target_position[0] * COUNTS), abs=1)


def test_an_axis_without_bit_12_for_10_ms_is_given_up() -> None:
    b = working(CSP)
    b.drives[0].follows = False
    b.steps(9)
    assert b.stop_reason[0] == StopReason.NONE
    b.steps(4)
    assert b.stop_reason[0] == StopReason.NOT_FOLLOWING


# ---- modes


def switching(first: int, then: int, **more: object) -> tuple[Bench, Recorder]:
    """An axis whose drive goes on showing the first mode after a request for another one."""
    b = working(first, **more)
    b.drives[0].torque, b.drives[0].velocity = 700, 300
    b.target_torque[0] = 0.5
    b.target_velocity[0] = 0.3
    b.engine.next()
    b.drives[0].mode_shown = first
    b.mode_target[0] = then
    return b, Recorder(b)


def test_cst_keeps_its_torque_until_0x6061_shows_csp() -> None:
    b, log = switching(CST, CSP)
    b.drives[0].moves = False
    b.drives[0].position = 1234
    b.steps(10)
    assert set(log.torques) == {500}
    assert set(log.modes[1:]) == {CSP}
    assert set(log.positions[2:]) == {1234}
    b.drives[0].mode_shown = None
    b.steps(5)
    assert b.axis_flags[0] & 1
    assert log.positions[-1] == 1234


def test_cst_that_waits_longer_than_20_ms_for_another_mode_is_stopped() -> None:
    b, log = switching(CST, CSP)
    b.steps(30)
    assert b.stop_reason[0] == StopReason.MODE_CHANGE
    assert log.torques[log.words.index(QUICK_STOP)] == 500


@pytest.mark.parametrize("mapped", [True, False])
def test_cst_is_entered_with_the_torque_that_holds_the_load(mapped: bool) -> None:
    demand = number(3, 32, scale=NM) if mapped else None  # in the place of the actual velocity
    more = {"actual_velocity": None, "torque_demand": demand} if mapped else {}
    b, log = switching(CSP, CST, **more)
    b.drives[0].velocity = 650  # 0x6074 where it is mapped
    b.steps(5)
    b.drives[0].mode_shown = None
    b.steps(5)
    assert set(log.torques[2:]) == {650 if mapped else 700}
    assert b.axis_flags[0] & 1


def test_csv_is_entered_with_the_actual_velocity() -> None:
    b, log = switching(CSP, CSV)
    b.steps(5)
    b.drives[0].mode_shown = None
    b.steps(2)
    assert set(log.velocities[2:]) == {300}


def test_a_mode_that_is_not_shown_within_100_ms_is_restored_and_reported() -> None:
    b, log = switching(CSP, CSV)
    b.steps(98)
    assert log.modes[-1] == CSV
    flags = 0
    for _ in range(8):
        flags |= b.engine.next()
    assert flags & CYCLE_DROPPED
    assert b.axis_flags[0] & AXIS_MODE_REFUSED
    assert log.modes[-1] == CSP
    b.steps(5)
    assert b.axis_flags[0] & 1  # and follows in the old mode
    b.mode_target[0] = CSP
    b.steps(2)
    assert not b.axis_flags[0] & AXIS_MODE_REFUSED


# ---- stops


class Stubborn(ScriptedDrive):
    """A drive that stays in OPERATION_ENABLED whatever it is commanded, but for some commands."""

    obeys: tuple[int, ...] = (DISABLE_VOLTAGE,)

    def after(self, before: int) -> int:
        if self.state == OE and self.controlword & 0x0F not in self.obeys:
            return OE
        return super().after(before)


@pytest.mark.parametrize(("mode", "patience"), [(CST, 20), (CSP, 50), (CSV, 50)])
def test_a_quick_stop_without_effect_ends_in_disable_voltage(mode: int, patience: int) -> None:
    b = working(mode, drive=Stubborn())
    if mode == CST:
        b.target_torque[0] = 0.5
        b.steps(2)
    log = Recorder(b)
    b.ask(REQUEST_QUICK_STOP)
    b.steps(100)
    runs = [
        word & 0x0F
        for word, before in zip(log.words, [None, *log.words], strict=False)
        if word != before
    ]
    assert runs[-4:] == [ENABLE, QUICK_STOP, DISABLE_OPERATION, DISABLE_VOLTAGE][-len(runs) :]
    assert log.words.count(QUICK_STOP) == pytest.approx(patience, abs=1)
    assert log.words.count(DISABLE_OPERATION) == pytest.approx(20, abs=1)
    if mode == CST:
        before_cut = log.words.index(DISABLE_VOLTAGE)
        assert set(log.torques[:before_cut]) == {500}
        assert set(log.torques[before_cut:]) == {0}


def test_a_drive_that_ramps_down_shows_it_by_bit_12_and_has_time() -> None:
    drive = Stubborn()
    b = working(CSP, drive=drive)
    log = Recorder(b)
    b.ask(REQUEST_DISABLED)
    b.steps(2)
    drive.follows = False
    b.steps(500)
    assert set(log.words[2:]) == {DISABLE_OPERATION}


@pytest.mark.parametrize("velocity_limit", [None, 1000.0])
def test_standstill_does_not_depend_on_the_velocity_limit(velocity_limit: float | None) -> None:
    b = working(CSP, limits=AxisLimits(velocity=velocity_limit))
    b.drives[0].stays_in_quick_stop = True
    b.drives[0].velocity = 60  # 0.06 rad/s: not at rest
    b.ask(REQUEST_QUICK_STOP)
    b.steps(50)
    assert b.drives[0].state == 5
    b.drives[0].velocity = 40
    b.steps(20)
    assert b.drives[0].state != 5


def test_on_loss_disable_operation_takes_the_place_of_quick_stop() -> None:
    b = working(CST, on_loss="disable")
    log = Recorder(b)
    b.engine.spend(15 * MS)
    assert QUICK_STOP not in log.words
    assert DISABLE_OPERATION in log.words


def test_on_loss_csp_hold_holds_the_position_until_a_new_request() -> None:
    b = working(CST, on_loss="csp_hold")
    b.target_torque[0] = 0.5
    b.engine.next()
    b.drives[0].position = 321
    log = Recorder(b)
    flags = 0
    b.engine.spend(100 * MS)
    flags |= b.engine.next()
    assert flags & CYCLE_DROPPED
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert set(log.words) == {ENABLE}
    assert log.modes[-1] == CSP
    assert log.positions[-1] == 321
    assert not b.axis_flags[0] & 1
    b.ask(REQUEST_ENABLED)
    b.steps(20)
    assert log.modes[-1] == CST
    assert b.axis_flags[0] & 1


def test_a_stop_request_has_its_reason_and_counts_as_no_event() -> None:
    b = working(CSP)
    b.engine.quick_stop_all()
    b.steps(5)
    assert b.stop_reason[0] == StopReason.STOP_REQUEST


def test_reasons_of_faults_and_of_drives_that_leave_by_themselves() -> None:
    for state, reason in ((7, StopReason.FAULT), (1, StopReason.LEFT_OPERATION)):
        b = working(CSP)
        b.drives[0].state = state
        b.drives[0].after = lambda before, state=state: state  # type: ignore[method-assign]
        b.steps(2)
        assert b.stop_reason[0] == reason


# ---- stops: repeated, of lost devices, without a velocity


@pytest.mark.parametrize("requested_state", [REQUEST_QUICK_STOP, REQUEST_DISABLED])
@pytest.mark.parametrize("all_axes", [False, True])
def test_a_stop_that_is_requested_in_every_cycle_still_ends(
    requested_state: int, all_axes: bool
) -> None:
    b = working(CST, drive=Stubborn())
    for _ in range(100):
        b.ask(requested_state)
        if all_axes:
            b.engine.quick_stop_all()
        b.engine.next()
    assert b.drives[0].controlword == DISABLE_VOLTAGE


def test_a_lost_device_that_returns_under_power_gets_a_quick_stop_first() -> None:
    b = working(CSP, drive=Stubborn())
    b.segment.silent.add(0)
    b.steps(200)
    log = Recorder(b)
    b.segment.silent.clear()
    b.steps(80)
    assert log.words[:40] == [QUICK_STOP] * 40
    assert log.words[-1] == DISABLE_VOLTAGE


@pytest.mark.parametrize("measured", [True, False])
def test_quick_stop_active_ends_where_a_standstill_is_not_seen(measured: bool) -> None:
    """The velocity is noise, or the drive has none."""
    nothing = {"actual_velocity": None, "actual_position": None, "target_position": None}
    b = working(CST, **({} if measured else nothing))
    b.drives[0].stays_in_quick_stop = True
    b.drives[0].velocity = 100
    b.ask(REQUEST_QUICK_STOP)
    b.steps(1990)
    assert b.drives[0].state == 5
    b.steps(20)
    assert b.drives[0].state == 1
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert b.axis_flags[0] & 1


@pytest.mark.parametrize("cycles_before", [0, 4])
def test_a_stop_during_a_change_to_cst_keeps_the_torque_that_holds(cycles_before: int) -> None:
    b, log = switching(CSP, CST)
    if cycles_before:
        b.steps(cycles_before)
    b.drives[0].after = lambda before: OE  # type: ignore[method-assign]
    b.ask(REQUEST_QUICK_STOP)
    b.steps(10)
    stop = log.words.index(QUICK_STOP)
    assert set(log.torques[stop:]) == {700}


def test_csp_hold_does_not_lapse() -> None:
    """A request to enable lapses after 10 s, a hold does not."""
    b = working(CST, on_loss="csp_hold")
    b.target_torque[0] = 0.5
    b.engine.next()
    log = Recorder(b)
    b.engine.spend(11_000 * MS)
    b.engine.next()
    assert set(log.words) == {ENABLE}
    assert b.stop_reason[0] == StopReason.UNDERRUN


def test_refused_and_missing_set_points_count_together() -> None:
    b = working(CST)
    b.target_torque[0] = 0.5
    b.steps(2)
    log = Recorder(b)
    for _ in range(5):
        b.target_torque[0] = np.nan
        b.engine.next()
        b.engine.spend(2 * MS)
    assert log.words.index(QUICK_STOP) == 9
    assert b.stop_reason[0] in (StopReason.NONE, StopReason.REFUSED)


# ---- modes: blind, by the drive itself, slow, again


def test_a_drive_that_shows_cst_by_itself_gets_the_torque_that_holds() -> None:
    b = working(CSP)
    b.drives[0].torque = 700
    b.drives[0].mode_shown = CST
    log = Recorder(b)
    b.steps(6)
    assert set(log.torques[2:]) == {700}


def test_a_powered_axis_without_any_torque_value_does_not_enter_cst() -> None:
    b, log = switching(CSP, CST, actual_torque=None)
    b.drives[0].mode_shown = None
    flags = b.engine.next() | b.engine.next()
    assert flags & CYCLE_DROPPED
    assert b.axis_flags[0] & AXIS_MODE_REFUSED
    assert set(log.modes) == {CSP}
    b.ask(REQUEST_DISABLED)
    b.steps(5)
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert log.modes[-1] == CST  # not powered, it may


def test_a_refused_mode_is_tried_again_with_the_next_request() -> None:
    b, log = switching(CSP, CST)
    b.steps(110)
    assert b.axis_flags[0] & AXIS_MODE_REFUSED
    b.ask(REQUEST_DISABLED)
    b.steps(10)
    b.drives[0].mode_shown = None
    b.ask(REQUEST_ENABLED)
    b.steps(10)
    assert log.modes[-1] == CST
    assert not b.axis_flags[0] & AXIS_MODE_REFUSED


def test_csp_is_entered_from_profile_position_at_the_actual_position() -> None:
    b = working(1)
    b.drives[0].moves = False
    b.target_position[0] = 3.0  # bit 4 has not started it
    b.steps(3)
    b.engine.spend(2 * MS)
    assert b.drives[0].target_position == 3000
    b.mode_target[0] = CSP
    log = Recorder(b)
    b.steps(6)
    assert {p for p, mode in zip(log.positions, log.modes, strict=True) if mode == CSP} == {0}


class OneExchangeLater(ScriptedDrive):
    """A drive that shows a new mode in the exchange after the one that requests it."""

    def exchange(self, outputs: bytes) -> bytes:
        self.mode_shown = self.mode
        return super().exchange(outputs)


@pytest.mark.parametrize(("first", "then", "divider"), [(CSP, CSV, 60), (CST, CSP, 12)])
def test_a_change_of_mode_has_time_for_some_exchanges_of_the_device(
    first: int, then: int, divider: int
) -> None:
    frames = (frame_plan([al_status(1)]), replace(frame_plan([lrw(0)]), divider=divider))
    units = (SyncUnit("slow", (0,), divider=divider),)
    b = bench(axis(0, mode=first), drives=[OneExchangeLater()], frames=frames, sync_units=units)
    b.ask(REQUEST_ENABLED)
    b.steps(8 * divider)
    assert b.axis_flags[0] & 1
    b.mode_target[0] = then
    b.steps(5 * divider)
    assert b.axis_flags[0] & 1
    assert not b.axis_flags[0] & AXIS_MODE_REFUSED
    assert b.drives[0].mode == then


def test_homing_does_not_judge_the_torque_set_point() -> None:
    b = working(CSP)
    b.mode_target[0] = 6
    b.steps(4)
    b.target_torque[0] = np.nan
    b.steps(100)
    assert b.axis_flags[0] & 1


# ---- the brake, and the ends of laws and streams


@pytest.mark.parametrize("late", range(8))
def test_a_late_commit_does_not_open_the_brake_without_torque(late: int) -> None:
    b = bench(axis(0, mode=CST), drives=[ScriptedDrive()])
    log = Recorder(b)
    b.ask(REQUEST_ENABLED)
    for k in range(12):
        b.target_torque[0] = 0.5
        if k == late:
            b.engine.spend(1 * MS)
        b.engine.next()
    assert set(log.torques[log.words.index(ENABLE) :]) == {500}


def test_a_closed_stream_of_positions_is_not_continued() -> None:
    b = working(CSP, deceleration=100.0)
    stream = Stream(1, 100)
    b.engine.set_stream(stream)
    rows = np.zeros((20, 3))
    rows[:, 0] = 0.002 * np.arange(1, 21)
    stream.write(rows.tobytes(), b.engine.number)
    b.steps(20)
    b.engine.set_stream(None)
    log = Recorder(b)
    b.engine.spend(30 * MS)
    assert log.positions[-1] - 40 <= 20  # 2 rad/s at 100 rad/s²


def test_a_closed_stream_of_torques_is_a_hand_over() -> None:
    b = working(CST)
    stream = Stream(1, 100)
    b.engine.set_stream(stream)
    rows = np.zeros((20, 3))
    rows[:, 2] = 0.5
    stream.write(rows.tobytes(), b.engine.number)
    b.steps(20)
    b.engine.set_stream(None)
    log = Recorder(b)
    b.engine.spend(15 * MS)  # longer than the late limit
    assert set(log.words) == {ENABLE}
    assert set(log.torques) == {500}
