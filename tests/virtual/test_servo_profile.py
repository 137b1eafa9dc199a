"""Profile position and profile velocity of the servo, IEC 61800-7-201 / CiA 402-2."""

from __future__ import annotations

import math

import pytest

from catenary.virtual import Servo, ServoQuirks, _segment
from tests.virtual.servo_drive import CSP, ENABLE, QUICK_STOP, STATE_MASK, TURN, Drive, Inputs

PP, PV = 1, 3
NEW, AT_ONCE, RELATIVE, HALT = 0x10, 0x20, 0x40, 0x100
REACHED, ACKNOWLEDGED, LIMIT = 0x0400, 0x1000, 0x0800
RADIAN = TURN / math.tau


def set_rates(
    drive: Drive, *, velocity: float = 2.0, acceleration: float = 20.0, deceleration: float = 20.0
) -> None:
    """Write 0x6081 [rad/s], 0x6083 and 0x6084 [rad/s²]."""
    for slot, value in (
        (_segment.SLOT_PROFILE_VELOCITY, velocity),
        (_segment.SLOT_ACCELERATION, acceleration),
        (_segment.SLOT_DECELERATION, deceleration),
    ):
        drive.servo.core.put_slot(drive.servo.position, slot, round(value * RADIAN))


def enabled(mode: int, servo: Servo | None = None) -> Drive:
    drive = Drive(servo or Servo())
    set_rates(drive)
    drive.enable(mode)
    return drive


def set_point(drive: Drive, radians: float, bits: int = AT_ONCE) -> Inputs:
    """Send one set-point with the complete handshake."""
    drive.position = round(radians * RADIAN)
    drive.word = ENABLE | NEW | bits
    assert drive.cycle(3).status & ACKNOWLEDGED
    drive.word = ENABLE
    return drive.cycle(3)


def test_target_without_bit_4_has_no_effect() -> None:
    drive = enabled(PP)
    drive.position = TURN
    drive.cycle(200)
    assert drive.servo.position_rad == pytest.approx(0.0, abs=1e-3)


def test_set_point_is_acknowledged_and_reached() -> None:
    drive = enabled(PP)
    drive.position = round(1.0 * RADIAN)
    drive.word = ENABLE | NEW | AT_ONCE
    inputs = drive.cycle(3)
    assert inputs.status & ACKNOWLEDGED
    assert not inputs.status & REACHED
    inputs = drive.cycle(20)
    assert inputs.status & ACKNOWLEDGED  # while bit 4 is set
    drive.word = ENABLE
    assert not drive.cycle(3).status & ACKNOWLEDGED
    inputs = drive.cycle(800)
    assert inputs.status & REACHED
    assert drive.servo.position_rad == pytest.approx(1.0, abs=1e-3)


def test_motion_is_the_specified_trapezoid() -> None:
    drive = enabled(PP)
    set_point(drive, 1.0)
    fastest, cycles = 0.0, 0
    while not drive.cycle().status & REACHED:
        fastest = max(fastest, drive.servo.velocity_rad_s)
        cycles += 1
    assert fastest == pytest.approx(2.0, rel=0.02)
    assert cycles == pytest.approx(600, abs=30)  # 1 rad at 2 rad/s, plus 0.1 s for the ramps


def test_second_set_point_waits_in_the_buffer() -> None:
    drive = enabled(PP)
    set_point(drive, 0.5)
    drive.position = round(-0.5 * RADIAN)
    drive.word = ENABLE | NEW
    assert drive.cycle(3).status & ACKNOWLEDGED
    drive.word = ENABLE
    assert drive.cycle(3).status & ACKNOWLEDGED  # the buffer is full
    furthest = 0.0
    for _ in range(1500):
        inputs = drive.cycle()
        furthest = max(furthest, drive.servo.position_rad)
    assert furthest == pytest.approx(0.5, abs=2e-3)
    assert drive.servo.position_rad == pytest.approx(-0.5, abs=1e-3)
    assert not inputs.status & ACKNOWLEDGED
    assert inputs.status & REACHED


def test_immediate_change_reverses_the_motion() -> None:
    drive = enabled(PP)
    set_point(drive, 2.0)
    drive.cycle(300)
    set_point(drive, 0.0)
    drive.cycle(1500)
    assert drive.servo.position_rad == pytest.approx(0.0, abs=1e-3)


def test_relative_set_point_starts_from_the_last_target() -> None:
    drive = enabled(PP)
    set_point(drive, 0.3)
    drive.cycle(500)
    set_point(drive, 0.2, AT_ONCE | RELATIVE)
    drive.cycle(500)
    assert drive.servo.position_rad == pytest.approx(0.5, abs=1e-3)


def test_motion_continues_after_halt() -> None:
    drive = enabled(PP)
    set_point(drive, 2.0)
    drive.cycle(300)
    drive.word = ENABLE | HALT
    drive.cycle(30)
    assert 0.5 < drive.servo.velocity_rad_s < 1.8  # on the ramp of 20 rad/s²
    inputs = drive.cycle(120)
    assert inputs.status & REACHED  # with halt: standstill
    held = drive.servo.position_rad
    drive.cycle(100)
    assert drive.servo.position_rad == pytest.approx(held, abs=1e-3)
    drive.word = ENABLE
    drive.cycle(1500)
    assert drive.servo.position_rad == pytest.approx(2.0, abs=1e-3)


def test_quick_stop_ends_the_motion() -> None:
    drive = enabled(PP)
    set_point(drive, 2.0)
    drive.cycle(300)
    drive.word = QUICK_STOP
    drive.cycle(300)
    stopped = drive.servo.position_rad
    drive.position = 0
    drive.enable(PP)
    drive.cycle(300)
    assert drive.servo.position_rad == pytest.approx(stopped, abs=5e-3)


def test_target_stays_within_the_software_limits() -> None:
    drive = enabled(PP, Servo(position_limits=(-0.2, 0.2)))
    set_point(drive, 1.0)
    assert drive.cycle(500).status & LIMIT
    assert drive.servo.position_rad == pytest.approx(0.2, abs=1e-3)


def test_csp_continues_from_the_end_of_pp() -> None:
    drive = enabled(PP)
    set_point(drive, 0.5)
    drive.mode, drive.position = CSP, drive.cycle(600).position
    assert drive.cycle(5).mode == CSP
    assert drive.cycle(100).status & STATE_MASK == 0x27
    assert drive.servo.position_rad == pytest.approx(0.5, abs=2e-3)


def test_profile_velocity_ramps_and_reports_target_reached() -> None:
    drive = enabled(PV)
    assert drive.cycle().status & ACKNOWLEDGED  # bit 12: the speed is 0
    drive.velocity = round(4.0 * RADIAN)
    inputs = drive.cycle(100)
    assert drive.servo.velocity_rad_s == pytest.approx(2.0, rel=0.1)  # 20 rad/s² for 0.1 s
    assert not inputs.status & REACHED
    inputs = drive.cycle(200)
    assert inputs.status & REACHED
    assert not inputs.status & ACKNOWLEDGED
    assert drive.servo.velocity_rad_s == pytest.approx(4.0, rel=0.01)
    drive.word = ENABLE | HALT
    assert drive.cycle(400).status & REACHED
    assert drive.servo.velocity_rad_s == pytest.approx(0.0, abs=0.01)


def test_bit_12_quirks_do_not_affect_profile_modes() -> None:
    drive = enabled(PP, Servo(quirks=ServoQuirks(bit_12="never")))
    set_point(drive, 0.2)
    drive.cycle(400)
    assert drive.servo.position_rad == pytest.approx(0.2, abs=1e-3)
