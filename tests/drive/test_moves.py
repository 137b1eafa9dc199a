"""Moves: profiles of the loop in CSP, of the drive in PP and PV, and their results."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.drive import Drives
from catenary.drive.move import Move
from catenary.drive.port import AxisPort
from catenary.drive.profile import Motion
from catenary.errors import ConfigurationError, DriveError, MoveError
from catenary.loop import Loop, StopPolicy
from catenary.virtual import Coupler, Segment, Servo, _segment

TURN = 2**20
OPTIONS: dict[str, Any] = {"counts_per_turn": TURN, "velocity_limit": 2.0}


@contextmanager
def opened(
    *servos: Servo, execution: str = "threaded", stop: StopPolicy | None = None, **options: Any
) -> Iterator[tuple[Drives, Loop]]:
    with cat.MainDevice(Segment([Coupler(), *servos])) as main:
        arm = Drives(main.scan().drives, **{**OPTIONS, **options})
        with Loop(arm, execution=execution, stop=stop or StopPolicy()) as loop:
            next(loop)
            yield arm, loop


def trace(loop: Loop, move: Move, value: Callable[[], float], cycles: int = 5000) -> list[float]:
    """Iterate until the move is done; return the values of each cycle."""
    values: list[float] = []
    for _ in loop:
        values.append(value())
        if move.done:
            return values
        assert len(values) < cycles, "the move does not end"
    return values


def rates(positions: Sequence[float]) -> tuple[float, float]:
    """Return the largest velocity and acceleration of positions at 1 ms."""
    velocity = np.diff(positions) / 1e-3
    return float(abs(velocity).max()), float(abs(np.diff(velocity)).max() / 1e-3)


# ---- CSP


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_a_move_ends_at_its_goal_within_its_rates(execution: str) -> None:
    servo = Servo()
    with opened(servo, execution=execution) as (arm, loop):
        move = arm.move_to(0.5, velocity=1.0, acceleration=5.0)
        sent = trace(loop, move, lambda: arm.target.position.item(0))
        assert not arm.limited.any()
    assert move.outcome == "reached"
    assert move.error is None
    assert move.remaining == pytest.approx(0.0, abs=1e-3)
    velocity, acceleration = rates(sent)
    assert velocity == pytest.approx(1.0, rel=1e-3)
    assert acceleration == pytest.approx(5.0, rel=0.01)
    assert len(sent) == pytest.approx(700 + 20, abs=5)  # 0.5 s and 0.2 s for the ramps; settled
    assert servo.position_rad == pytest.approx(0.5, abs=1e-3)


def test_a_jerk_is_limited() -> None:
    pytest.importorskip("ruckig")
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(0.5, velocity=1.0, acceleration=5.0, jerk=50.0)
        sent = trace(loop, move, lambda: arm.target.position.item(0))
    jerk = np.diff(np.diff(np.diff(sent))) / 1e-9
    assert abs(jerk[3:-3]).max() == pytest.approx(50.0, rel=0.05)
    assert move.outcome == "reached"


def test_a_jerk_without_ruckig_is_a_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ruckig", None)
    with (
        opened(Servo()) as (arm, _),
        pytest.raises(ConfigurationError, match=r"ruckig.*\n.*catenary\[traj\]"),
    ):
        arm.move_to(0.5, jerk=50.0)


def test_each_axis_has_its_own_goal_and_the_others_hold() -> None:
    servos = Servo(), Servo(), Servo()
    with opened(*servos) as (arm, loop):
        loop.wait(arm.move_to([0.3, -0.2], axes=[0, 2], velocity=[1.0, 0.5]))
        assert arm.actual.position == pytest.approx([0.3, 0.0, -0.2], abs=1e-3)
        loop.wait(arm.move_by(0.1, axes=2))
        assert arm.actual.position == pytest.approx([0.3, 0.0, -0.1], abs=1e-3)


def test_the_defaults_are_the_limits_of_the_axis() -> None:
    with opened(Servo(), velocity_limit=0.5, acceleration_limit=4.0) as (arm, loop):
        move = arm.move_to(0.5)
        velocity, acceleration = rates(trace(loop, move, lambda: arm.target.position.item(0)))
        assert velocity == pytest.approx(0.5, rel=1e-3)
        assert acceleration == pytest.approx(4.0, rel=0.01)


def test_an_infinite_velocity_limit_needs_rates() -> None:
    options: dict[str, Any] = {"velocity_limit": math.inf, "step_limit": 1.0}
    with opened(Servo(), deceleration_limit=10.0, **options) as (arm, loop):
        with pytest.raises(ValueError, match=r"the move has no velocity; give velocity= \[rad/s\]"):
            arm.move_to(0.1)
        with pytest.raises(ValueError, match=r"the move has no acceleration; .*\[rad/s²\]"):
            arm.move_to(0.1, velocity=1.0)
        loop.wait(arm.move_to(0.2, velocity=1.0, acceleration=5.0))


def test_stop_decelerates_and_holds() -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(2.0, velocity=1.0, acceleration=5.0)
        loop_for(loop, 0.5)
        move.stop()
        sent = trace(loop, move, lambda: arm.target.position.item(0))
        assert move.outcome == "stopped"
        assert move.error is None
        assert rates(sent)[1] == pytest.approx(5.0, rel=0.02)
        held = arm.actual.position.item(0)
        loop_for(loop, 0.2)
        assert arm.actual.position[0] == pytest.approx(held, abs=1e-3)
        loop.wait(move)  # a requested stop is not an error


def test_a_stop_with_limited_jerk() -> None:
    pytest.importorskip("ruckig")
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(2.0, velocity=1.0, acceleration=5.0, jerk=100.0)
        loop_for(loop, 0.5)
        move.stop()
        sent = trace(loop, move, lambda: arm.target.position.item(0))
        assert rates(sent)[1] < 5.1
        assert arm.actual.velocity[0] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("jerk", [None, 200.0])
def test_a_new_move_continues_from_the_velocity_of_the_old_one(jerk: float | None) -> None:
    with opened(Servo(), Servo()) as (arm, loop):
        old = arm.move_to(2.0, velocity=1.0, acceleration=5.0, jerk=jerk)
        loop_for(loop, 0.5)
        new = arm.move_to(0.0, velocity=0.5, acceleration=5.0, jerk=jerk, axes=0)
        assert not old.done  # its other axis continues
        sent = trace(loop, new, lambda: arm.target.position.item(0))
        assert rates(sent)[1] < 5.2
        with pytest.raises(
            MoveError, match=r"1 Catenary virtual servo received another move"
        ) as raised:
            loop.wait(old)
        assert old.outcome == "replaced"
        assert raised.value.axis == arm.names[0]
        assert arm.actual.position == pytest.approx([0.0, 2.0], abs=1e-3)


def test_move_by_counts_from_the_goal() -> None:
    with opened(Servo()) as (arm, loop):
        arm.move_to(0.2)
        loop_for(loop, 0.02)
        loop.wait(arm.move_by(0.1))
        assert arm.actual.position[0] == pytest.approx(0.3, abs=1e-3)


def test_a_move_of_a_moving_axis_starts_at_its_velocity() -> None:
    with opened(Servo()) as (arm, loop):
        for cycle in loop:
            arm.target.position[:] += 0.5e-3
            if cycle.time > 0.5:
                break
        move = arm.move_to(1.0, velocity=0.5, acceleration=2.0)
        sent = trace(loop, move, lambda: arm.actual.velocity.item(0))
        assert min(sent[:100]) > 0.4
        assert move.outcome == "reached"


def test_late_iterations_do_not_slow_a_move_down() -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0, velocity=1.0, acceleration=5.0)
        for cycle in loop:
            if move.done:
                break
            if cycle.number % 50 == 49:
                cycle.spend(5e-3)
        assert cycle.time == pytest.approx(1.22, abs=0.02)
        assert arm.actual.position[0] == pytest.approx(1.0, abs=1e-3)


def test_after_a_long_pause_a_move_continues_within_its_velocity() -> None:
    with opened(Servo(), stop=StopPolicy(late_limit=0)) as (arm, loop):
        move = arm.move_to(0.5, velocity=0.1)
        loop_for(loop, 1.0).spend(3.0)
        velocities = trace(loop, move, lambda: arm.actual.velocity.item(0))
        assert max(velocities) < 0.5  # the limit is 2 rad/s
        assert move.outcome == "reached"
        assert arm.actual.position[0] == pytest.approx(0.5, abs=1e-3)


def test_a_move_with_too_little_acceleration_to_stop_before_a_limit() -> None:
    with opened(Servo(), position_max=1.0) as (arm, loop):
        fast = arm.move_to(0.9, velocity=2.0, acceleration=8.0)
        loop_for(loop, 0.4)
        with pytest.raises(
            ValueError, match=r"0\.5 rad/s², the axis stops from .* rad, beyond posit"
        ):
            arm.move_to(0.5, acceleration=0.5)
        loop.wait(fast)
        loop.wait(arm.move_to(0.5, acceleration=0.5))


def test_a_written_target_is_not_the_start_of_a_move_in_pp() -> None:
    with opened(Servo(), mode="pp") as (arm, loop):
        arm.target.position[:] = 0.5  # it has no effect
        loop_for(loop, 0.1)
        loop.wait(arm.move_by(0.1))
        assert arm.actual.position[0] == pytest.approx(0.1, abs=1e-3)
        loop.wait(arm.move_by(0.1))
        assert arm.actual.position[0] == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize("mode", ["csp", "pp"])
def test_the_goal_of_a_stopped_move_is_not_a_start(mode: str) -> None:
    with opened(Servo(), mode=mode) as (arm, loop):
        move = arm.move_to(2.0, velocity=0.5)
        loop_for(loop, 1.0)
        move.stop()
        for _ in range(2):  # requested, and begun
            start = arm.actual.position.item(0)
            arm.move_by(0.1).stop()
            next(loop)
        loop.wait(arm.move_by(0.1))
        assert arm.actual.position[0] == pytest.approx(start + 0.1, abs=0.02)


def test_a_stop_may_be_requested_in_the_middle_of_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.1)
        command = AxisPort.command

        def signal_handler(port: AxisPort, motion: Motion) -> None:
            move.stop()
            command(port, motion)

        monkeypatch.setattr(AxisPort, "command", signal_handler)
        loop.wait(move)
        assert move.outcome == "stopped"


def test_axes_are_selected_by_number() -> None:
    with opened(Servo(), Servo(), Servo()) as (arm, loop):
        loop.wait(arm.move_to(0.1, axes=(0, 2)))
        assert arm.actual.position == pytest.approx([0.1, 0.0, 0.1], abs=1e-3)
        arm.disable((0, 1))
        loop_for(loop, 0.1)
        arm.enable(arm.faults)  # none
        loop_for(loop, 0.1)
        assert arm.enabled.tolist() == [False, False, True]
        with pytest.raises(ValueError, match="selects no axis"):
            arm.move_to(0.1, axes=[])
        with pytest.raises(ValueError, match="selects no axis"):
            arm.home([])
        for axes in (5, "left", [0.5]):
            with pytest.raises(IndexError, match="no such axis; the axes are 0: 1 Catenary"):
                arm.move_to(0.1, axes=axes)  # type: ignore[arg-type]


# ---- with a stream


def test_no_move_while_a_stream_sets_the_targets() -> None:
    with opened(Servo()) as (arm, loop):
        stream = loop.stream(100)
        stream.write(np.zeros((50, 1)))
        next(loop)
        with pytest.raises(DriveError, match="cannot move: a law or a stream sets its targets"):
            arm.move_to(0.5)
        stream.close()
        next(loop)
        move = arm.move_to(0.1)
        with pytest.raises(RuntimeError, match="a stream cannot start during a move"):
            loop.stream(100)
        loop.wait(move)
        loop.stream(100)


def test_a_law_that_begins_after_the_request_ends_the_move() -> None:
    pytest.importorskip("numba")

    def hold(time: float) -> bool:
        return False

    with opened(Servo()) as (arm, loop):
        loop.start(cat.law(hold))
        move = arm.move_to(0.5)
        with pytest.raises(MoveError, match="a law or a stream now sets its targets"):
            loop.wait(move)
        assert arm.actual.position[0] == pytest.approx(0.0, abs=1e-3)


# ---- invalid requests


@pytest.mark.parametrize(
    ("call", "text"),
    [
        ({"position": 1.5}, r"goal 1\.5 rad is beyond position_max 1 rad"),
        ({"position": -1.5}, r"goal -1\.5 rad is beyond position_min -1 rad"),
        ({"position": 0.5, "velocity": 3.0}, r"velocity 3 rad/s is above velocity_limit 2 rad/s"),
        ({"position": 0.5, "acceleration": 9.0}, r"acceleration 9 rad/s² is above acc.*limit 8"),
        ({"position": 0.5, "velocity": 0.0}, "velocity must be positive"),
        ({"position": 0.5, "jerk": -1.0}, "jerk must be positive"),
        ({"position": math.nan}, "position=nan must be finite"),
        ({"position": [0.1, 0.2, 0.3]}, r"give one number, or 2 numbers"),
    ],
)
def test_beyond_a_limit(call: dict[str, Any], text: str) -> None:
    limits = {"position_min": -1.0, "position_max": 1.0, "acceleration_limit": 8.0}
    with opened(Servo(), Servo(), **limits) as (arm, _), pytest.raises(ValueError, match=text):
        arm.move_to(**call)


def test_a_mode_without_positions() -> None:
    with (
        opened(Servo(), mode="csv") as (arm, _),
        pytest.raises(ValueError, match=r"is in mode csv, but a move needs csp or pp; .*switch"),
    ):
        arm.move_to(0.5)


def test_an_axis_that_is_not_enabled() -> None:
    with opened(Servo(name="Left")) as (arm, loop):
        arm.disable()
        loop_for(loop, 0.1)
        with pytest.raises(DriveError, match=r"1 Left cannot move: it is not enabled \(READY"):
            arm.move_to(0.5)


# ---- other ends of a move


def test_a_fault_ends_the_move_and_reports_the_remaining_distance() -> None:
    servo = Servo(name="Left")
    with opened(servo, stop=StopPolicy(raise_faults=False)) as (arm, loop):
        move = arm.move_to(1.0, velocity=1.0)
        loop_for(loop, 0.3)
        servo.inject_fault(0x2310)
        with pytest.raises(MoveError, match=r"1 Left ended its move: the drive is in fault") as e:
            loop.wait(move)
        assert move.done
        assert move.outcome == "failed"
        assert move.error is e.value
        assert e.value.axis == "1 Left"
        assert 0.5 < e.value.remaining < 0.9


def test_after_the_error_of_the_iteration_the_move_is_done() -> None:
    servo = Servo()
    with opened(servo) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.3)
        servo.inject_fault(0x2310)
        with pytest.raises(DriveError, match="in fault"):
            loop.wait(move)
        assert move.outcome == "failed"


@pytest.mark.parametrize("call", ["quick_stop", "disable"])
def test_a_stop_of_the_axis_ends_the_move(call: str) -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.2)
        getattr(arm, call)()
        with pytest.raises(MoveError, match="disabled or stopped on request"):
            loop.wait(move)
        arm.enable()
        loop_for(loop, 0.3)
        held = arm.actual.position.item(0)
        loop_for(loop, 0.3)
        assert arm.actual.position[0] == pytest.approx(held, abs=1e-3)


def test_a_wait_that_takes_too_long_stops_the_move() -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0, velocity=0.1)
        with pytest.raises(MoveError, match=r"was still moving after 0\.5 s, 0\.9\d+ rad from"):
            loop.wait(move, timeout=0.5)
        loop_for(loop, 0.2)
        assert move.outcome == "stopped"
        assert arm.actual.velocity[0] == pytest.approx(0.0, abs=0.01)


def test_leaving_the_loop_ends_the_moves() -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.1)
    assert move.outcome == "failed"
    assert isinstance(move.error, MoveError)
    assert "was moving when the loop ended" in str(move.error)


def test_an_interrupt_in_the_middle_of_a_step_ends_the_move(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with opened(Servo()) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.1)

        def interrupted(port: AxisPort, motion: object) -> None:
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(AxisPort, "command", interrupted)
            with pytest.raises(KeyboardInterrupt):
                next(loop)
        loop_for(loop, 0.1)
        assert move.outcome == "failed"
        assert arm.actual.velocity[0] == pytest.approx(0.0, abs=0.01)


def test_another_mode_ends_the_move() -> None:
    with opened(Servo(), other_modes=["csv"]) as (arm, loop):
        move = arm.move_to(1.0)
        loop_for(loop, 0.1)
        arm.switch("csv")
        with pytest.raises(MoveError, match="its mode was changed"):
            loop.wait(move)


def test_drives_without_a_move_add_no_work_to_the_iteration() -> None:
    with opened(Servo()) as (arm, loop):
        movers = loop._opened.views.movers
        assert movers == []
        move = arm.move_to(0.01)
        assert len(movers) == 1
        loop.wait(move)
        assert movers == []


# ---- PP and PV


def test_pp_writes_the_rates_by_sdo() -> None:
    servo = Servo()
    with opened(servo, mode="pp", gear_ratio=10.0, direction=-1) as (arm, loop):
        move = arm.move_to(0.3, velocity=0.5, acceleration=2.0)
        fastest = max(abs(v) for v in trace(loop, move, lambda: arm.actual.velocity.item(0)))
        assert move.outcome == "reached"
        sdo = arm.subs[0].sdo
        answers = [sdo.request(index, type=cat.types.UDINT) for index in (0x6081, 0x6083, 0x6084)]
        loop_for(loop, 0.1)
        counts = TURN * 10 / math.tau
        assert [a.result() for a in answers] == [round(0.5 * counts), *[round(2.0 * counts)] * 2]
    assert fastest == pytest.approx(0.5, rel=0.02)
    assert servo.position_rad == pytest.approx(-3.0, abs=1e-2)


PROFILE_PDO = [
    *((0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32)),
    *((0x6081, 0, 32), (0x6083, 0, 32), (0x6084, 0, 32)),
]


@pytest.mark.parametrize("columns", [[], ["profile_velocity"]])
def test_pp_writes_the_rates_into_the_process_data_where_they_are_mapped(
    columns: list[str],
) -> None:
    mapped, other = Servo(), Servo()
    others = Segment([mapped, other])
    with cat.MainDevice(others) as main:
        subs = main.scan().drives
        left = Drives(subs[:1], mode="pp", pdos={0x1600: PROFILE_PDO}, columns=columns, **OPTIONS)
        right = Drives(subs[1:], mode="pp", **OPTIONS)  # by SDO
        with Loop(left, right) as loop:
            next(loop)
            assert rates_of(mapped)[0] == round(2.0 * TURN / math.tau)  # until a move
            moves = [arm.move_to(0.5, velocity=0.5, acceleration=2.0) for arm in (left, right)]
            for move in moves:
                loop.wait(move)
            for servo in (mapped, other):
                assert rates_of(servo) == [round(v * TURN / math.tau) for v in (0.5, 2.0, 2.0)]
                assert servo.position_rad == pytest.approx(0.5, abs=1e-3)
            if columns:
                assert left.target["profile_velocity"] == pytest.approx(0.5)


def rates_of(servo: Servo) -> list[int]:
    """Return 0x6081, 0x6083 and 0x6084 as the drive has them."""
    slots = (
        _segment.SLOT_PROFILE_VELOCITY,
        _segment.SLOT_ACCELERATION,
        _segment.SLOT_DECELERATION,
    )
    return [servo.core.slot(servo.position, slot) for slot in slots]


@pytest.mark.parametrize("mode", ["csp", "pp"])
@pytest.mark.parametrize(("execution", "divider"), [("inline", 1), ("threaded", 4), ("inline", 3)])
def test_moves_in_every_execution_and_with_a_divider(
    mode: str, execution: str, divider: int
) -> None:
    servos = Servo(axes=2), Servo()
    with opened(*servos, mode=mode, execution=execution, divider=divider) as (arm, loop):
        loop.wait(arm.move_to([0.2, -0.1, 0.3]))
        old = arm.move_to(1.0)
        loop_for(loop, 0.02)
        loop.wait(arm.move_to(0.0))
        assert old.outcome == "replaced"
        truth = [servos[0].axis_position(0), servos[0].axis_position(1), servos[1].position_rad]
        assert truth == pytest.approx([0.0] * 3, abs=1e-3)


def test_a_stop_in_pp_halts_and_holds() -> None:
    servo = Servo()
    with opened(servo, mode="pp") as (arm, loop):
        move = arm.move_to(1.0, velocity=0.5, acceleration=2.0)
        loop_for(loop, 0.6)
        move.stop()
        trace(loop, move, lambda: 0.0)
        assert move.outcome == "stopped"
        held = servo.position_rad
        assert 0.2 < held < 0.5
        loop_for(loop, 0.5)
        assert servo.position_rad == pytest.approx(held, abs=2e-3)
        loop.wait(arm.move_to(0.0))
        assert servo.position_rad == pytest.approx(0.0, abs=1e-3)


def test_a_new_move_in_pp_replaces_the_old_one_at_once() -> None:
    servo = Servo()
    with opened(servo, mode="pp") as (arm, loop):
        old = arm.move_to(1.0, velocity=0.5)
        loop_for(loop, 0.005)  # in the middle of the handshake
        new = arm.move_to(-0.2, velocity=0.5)
        furthest = max(trace(loop, new, lambda: servo.position_rad))
        assert furthest < 0.05
        assert (old.outcome, new.outcome) == ("replaced", "reached")
    assert servo.position_rad == pytest.approx(-0.2, abs=1e-3)


def test_a_written_target_has_no_effect_in_pp() -> None:
    servo = Servo()
    with opened(servo, mode="pp") as (arm, loop):
        for cycle in loop:
            arm.target.position[:] = 0.5
            if cycle.time > 0.3:
                break
        assert servo.position_rad == pytest.approx(0.0, abs=1e-3)


def test_pp_to_csp_and_back() -> None:
    servo = Servo()
    with opened(servo, mode="pp", other_modes=["csp", "pv"]) as (arm, loop):
        for mode in ("csp", "pp"):
            loop.wait(arm.move_by(0.2))
            arm.switch(mode)
            loop_for(loop, 0.1)
            assert arm.enabled.all()
        assert servo.position_rad == pytest.approx(0.4, abs=2e-3)


def test_a_jerk_in_pp_is_refused() -> None:
    with (
        opened(Servo(), mode="pp") as (arm, _),
        pytest.raises(ValueError, match="jerk= is not possible in mode pp"),
    ):
        arm.move_to(0.5, jerk=10.0)


def test_pv_ramps_in_the_drive() -> None:
    servo = Servo()
    options: dict[str, Any] = {"acceleration_limit": 4.0, "deceleration_limit": 4.0}
    with opened(servo, mode="pv", **options) as (arm, loop):
        for cycle in loop:
            arm.target.velocity[:] = 5.0  # limited to 2 rad/s
            if cycle.time > 0.25:
                break
        assert servo.velocity_rad_s == pytest.approx(1.0, abs=0.1)
        loop_for(loop, 0.5)
        assert servo.velocity_rad_s == pytest.approx(2.0, rel=0.01)


def test_pv_needs_a_velocity_limit() -> None:
    with (
        pytest.raises(ValueError, match="required in PV"),
        opened(Servo(), mode="pv", velocity_limit=None),
    ):
        pass


# ---- linear axes


def test_a_linear_axis_is_in_metres_and_newtons() -> None:
    servo = Servo(rated_torque=2.0)
    linear: dict[str, Any] = {"metres_per_turn": 0.01, "gear_ratio": 2.0, "force_limit": 60.0}
    with opened(servo, velocity_limit=0.1, position_max=0.2, **linear) as (arm, loop):
        loop.wait(arm.move_to(0.05, velocity=0.05))
        assert arm.actual.position[0] == pytest.approx(0.05, abs=1e-5)
        assert servo.position_rad == pytest.approx(0.05 / 0.01 * 2 * math.tau, rel=1e-3)
        servo.apply_load(1.0)
        loop_for(loop, 0.3)
        force = 1.0 * math.tau * 2 / 0.01  # of 1 N·m at the motor
        assert abs(arm.actual.torque[0]) == pytest.approx(force, rel=0.05)
        with pytest.raises(ValueError, match=r"goal 0\.3 m is beyond position_max 0\.2 m"):
            arm.move_to(0.3)
        text = str(loop.plan)
        assert "velocity 0.1 m/s (option)" in text
        assert "force 60 N (option)" in text


def loop_for(loop: Loop, seconds: float) -> cat.Cycle:
    begun: float | None = None
    for cycle in loop:
        begun = cycle.time if begun is None else begun
        if cycle.time - begun >= seconds:
            return cycle
    raise AssertionError("the iteration ended")
