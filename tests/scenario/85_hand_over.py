"""A law ends, and the application computes for a second before it writes set-points again.
CSP and CSV decelerate and hold. CST keeps its torque for 20 ms, then the drive stops quickly and
the brake closes: the arm falls no further than the brake's time allows.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LoopError
from catenary.plan.stop_reason import StopReason
from catenary.virtual import Joint, Plant, Segment, Server, Servo
from tests.scenario.frames import sent_to_axis
from tests.scenario.vertical import (
    GEAR,
    LOAD,
    MODEL,
    MS,
    RESOLUTION,
    SERVO,
    follow,
    until_taken,
    vertical_cell,
)

pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
HANDOVER = 0.020  # s
REACTION = HANDOVER + 2 * MS  # the frame of the quick stop, and its effect
DECELERATION = 10.0  # rad/s²


@cat.law
def carry(actual, target, parameters, time):
    for i in range(actual.n):
        target.torque[i] = parameters[0]
    return time > parameters[1]


@cat.law
def drive(actual, target, memory, parameters, time):
    for i in range(actual.n):
        memory[i] += parameters[0] * actual.dt
        target.position[i] = memory[i]
        target.velocity[i] = parameters[0]
    return time > parameters[1]


@pytest.mark.parametrize("torque", [LOAD, 15.0, 35.0])
def test_cst_keeps_its_torque_for_20_ms_then_the_brake_closes(torque: float) -> None:
    """Bound: the way with the kept torque, the drive's ramp (0x6085), the fall until the brake has
    closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            cycle = follow(cell, arm, loop, 100)
            loop.run(carry, parameters=[torque, 0.02])
            before, downwards = cell.joint, -cell.velocity
            kept = cell.kept_torque(torque, REACTION, downwards)
            trace = cell.compute(cycle, 1.0)
            next(loop)
            assert arm.stopped == (StopReason.HANDOVER,)
        assert HANDOVER <= trace.powered_ms * MS <= REACTION or torque != LOAD
        assert trace.torque[:19] == pytest.approx(torque, abs=0.1)
        assert trace.fall(before) < kept.ramp_bound() + cell.fall_bound() + RESOLUTION
        assert abs(trace.joint[-1] - trace.joint[500]) < 1e-5  # the brake holds


def test_the_stream_is_closed_and_cst_is_handed_over(tmp_path: Path) -> None:
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            follow(cell, arm, loop, 100)
            stream = loop.stream()
            stream.write(torque=[[cell.gravity]] * 50)
            cycle = until_taken(loop, stream, 50)
            stream.close()
            before = cell.joint
            trace = cell.compute(cycle, 1.0)
            next(loop)
            assert arm.stopped == (StopReason.HANDOVER,)
            plan = loop.plan.cycle
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION
    sent = sent_to_axis(recording, plan)
    stop = next(k for k, each in enumerate(sent) if each.controlword == 0x02)
    assert {each.torque for each in sent[stop - 20 : stop + 2]} == {500}


@pytest.mark.parametrize("mode", ["csp", "csv"])
def test_csp_and_csv_decelerate_and_hold_without_limit(mode: str) -> None:
    """Bound: the way v² / 2a of the deceleration and the drive's lag, in both directions."""
    for velocity in (-0.5, 0.5):
        with vertical_cell() as cell:
            arm = cell.drives(mode=mode, velocity_limit=2.0, deceleration_limit=DECELERATION)
            with cat.Loop(arm) as loop:
                cycle = follow(cell, arm, loop, 100)
                loop.run(drive, memory=arm.actual.position, parameters=[velocity, 0.3])
                before = cell.joint
                trace = cell.compute(cycle, 5.0)
                assert trace.powered.all()
                next(loop)
                assert arm.enabled.all()
            way = velocity**2 / (2 * DECELERATION) + abs(velocity) * 0.014  # 1 / position gain, LAG
            assert abs(trace.joint - before).max() < way + RESOLUTION
            assert abs(trace.joint[1000:] - trace.joint[-1]).max() < 1e-4


def test_an_application_in_time_takes_the_load_over() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            cycle = follow(cell, arm, loop, 100)
            loop.run(carry, parameters=[cell.gravity, 0.02])
            before = cell.joint
            trace = cell.compute(cycle, 0.015)
            follow(cell, arm, loop, 500)
            assert cell.powered
        assert trace.powered.all()
        assert abs(cell.fall(before)) < cell.fall_bound() + RESOLUTION


def test_wait_locked_refuses_an_axis_that_is_powered_in_cst() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0, dc=True)
        with pytest.raises(LoopError, match="lift powered in CST"), cat.Loop(arm) as loop:
            loop.wait_locked()  # not powered yet
            follow(cell, arm, loop, 100)
            before = cell.joint
            loop.wait_locked()
        cell.let_pass(1.0)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION


def served_arm(nic: str) -> tuple[Server, Servo, Plant]:
    """The rig on a wire, in real time."""
    servo = Servo(name="lift", **SERVO)  # type: ignore[arg-type]
    plant = Plant(MODEL, [Joint("shoulder", GEAR, brake=150.0, brake_delay=0.030)])
    return Server(Segment([servo], plant=plant, clock="monotonic"), nic, max_age=None), servo, plant


def test_in_real_time_with_real_frames(veth: tuple[str, str]) -> None:
    """The torque is that of gravity, so that the bound does not depend on the machine's timing."""
    with vertical_cell() as twin:
        bound = twin.fall_bound() + RESOLUTION
    server, servo, plant = served_arm(veth[1])
    with server, cat.MainDevice(veth[0]) as main:
        arm = cat.Drives(
            main.scan().drives,
            counts_per_turn=131072,
            gear_ratio=GEAR,
            mode="cst",
            velocity_limit=6.0,
        )
        loop = cat.Loop(
            arm,
            period=2e-3,
            laws=[carry],  # compiled before the axis is powered
            stop=cat.StopPolicy(on_axis_stopped="event", lost_limit=1000, late_limit=0.5),
            watchdog=1.0,
        )
        with loop:
            for cycle in loop:
                arm.target.torque[:] = LOAD
                if cycle.number == 50:
                    break
            loop.run(carry, parameters=[LOAD, 0.05])
            cycle.spend(1.0)
            assert servo.drive_state() != "OPERATION ENABLED"
            assert 1e-4 < -float(plant.data.qpos[0]) < bound  # it began at 0
            next(loop)
            assert arm.stopped == (StopReason.HANDOVER,)
