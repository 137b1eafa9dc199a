"""Profile position and profile velocity in the core: the drive generates the trajectory."""

import math

import pytest

from catenary.core import AXIS_FALLBACK, CYCLE_DROPPED, REQUEST_ENABLED, REQUEST_QUICK_STOP
from catenary.plan.cycle import AxisLimits
from catenary.plan.stop_reason import StopReason
from tests.core.rig import COUNTS, CSP, MS, Bench, ScriptedDrive, axis, bench

PP, PV = 1, 3
HALT, NEW_SET_POINT = 0x100, 0x10
OE = 4


def driving(mode: int, *, limits: AxisLimits | None = None, **more: object) -> Bench:
    """One axis in a profile mode, enabled, with a committed target."""
    b = bench(axis(0, mode=mode, limits=limits), drives=[ScriptedDrive(moves=False)], **more)
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    assert b.axis_flags[0] & 1
    return b


@pytest.mark.parametrize("order", ["threaded", "inline"])
def test_pp_sends_a_target_at_once_and_keeps_it(order: str) -> None:
    b = driving(PP, execution=order)
    b.target_position[0] = 5.0
    b.steps(2)
    assert b.drives[0].target_position == 5 * COUNTS


def test_no_underrun_stops_pp() -> None:
    b = driving(PP)
    b.target_position[0] = 5.0
    b.steps(1)
    b.engine.spend(500 * MS)
    flags = b.steps(1)
    assert not flags & CYCLE_DROPPED
    assert not b.axis_flags[0] & AXIS_FALLBACK
    assert b.stop_reason[0] == StopReason.NONE
    assert b.drives[0].target_position == 5 * COUNTS


def test_a_hand_over_keeps_the_target_of_pp() -> None:
    b = driving(PP)
    b.target_position[0] = 5.0
    b.steps(1)
    b.engine.run(200)
    assert b.drives[0].target_position == 5 * COUNTS
    assert b.axis_state[0] == OE


def test_pp_stays_within_the_position_limits_and_refuses_nan() -> None:
    b = driving(PP, limits=AxisLimits(-1.0, 1.0))
    b.target_position[0] = 5.0
    b.steps(2)
    assert b.drives[0].target_position == COUNTS
    b.target_position[0] = math.nan
    b.steps(2)
    assert b.drives[0].target_position == COUNTS


def test_bits_of_the_handshake_and_halt_reach_an_enabled_drive_only() -> None:
    b = driving(PP)
    b.controlword_bits[0] = HALT | NEW_SET_POINT
    b.steps(2)
    assert b.drives[0].controlword == 0x0F | HALT | NEW_SET_POINT
    b.ask(REQUEST_QUICK_STOP)
    b.steps(1)
    assert b.drives[0].controlword == 0x02


def test_an_underrun_in_pv_keeps_the_velocity_until_the_late_limit() -> None:
    b = driving(PV)
    b.target_velocity[0] = 2.0
    b.steps(2)
    b.engine.spend(40 * MS)
    assert b.drives[0].target_velocity == 2 * COUNTS
    b.engine.spend(20 * MS)
    flags = b.steps(1)
    assert flags & CYCLE_DROPPED
    assert b.stop_reason[0] == StopReason.UNDERRUN
    assert b.drives[0].state != OE


def test_a_hand_over_in_pv_commands_standstill_at_once() -> None:
    b = driving(PV)
    b.target_velocity[0] = 2.0
    b.steps(2)
    b.engine.run(3)
    assert b.drives[0].target_velocity == 0
    b.engine.run(500)
    assert b.axis_state[0] == OE  # the drive holds


def test_pv_stays_within_the_velocity_limit() -> None:
    b = driving(PV, limits=AxisLimits(velocity=1.5))
    b.target_velocity[0] = 2.0
    b.steps(2)
    assert b.drives[0].target_velocity == 1.5 * COUNTS


def test_a_stop_that_finds_bit_12_of_pp_does_not_wait_for_it() -> None:
    """It acknowledges a set-point there: its end does not show that the drive reacts."""
    b = bench(axis(0), drives=[ScriptedDrive()])
    b.enable()  # the drive has shown bit 12 of CSP
    b.mode_target[0] = PP
    b.steps(10)
    drive = b.drives[0]
    words: list[int] = []
    exchange = drive.exchange

    def ignoring(outputs: bytes) -> bytes:
        words.append(int.from_bytes(outputs[:2], "little"))
        drive.follows = False
        return exchange(b"\x0f\x00" + outputs[2:])

    drive.exchange = ignoring  # type: ignore[method-assign]
    b.ask(REQUEST_QUICK_STOP)
    b.steps(120)
    assert words[5] == 0x02
    assert words[-1] == 0x00  # after the patience, not after the stop deadline


def test_csp_begins_where_pp_has_stopped() -> None:
    b = bench(axis(0, mode=PP), drives=[ScriptedDrive(position=700, moves=False)])
    b.ask(REQUEST_ENABLED)
    b.steps(12)
    b.target_position[0] = 5.0
    b.steps(2)
    b.mode_target[0] = CSP
    b.steps(3)
    assert b.drives[0].target_position == 700
