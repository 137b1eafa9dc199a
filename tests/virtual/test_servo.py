"""Virtual servo: states, modes, limits, faults, stops and physics."""

from __future__ import annotations

import math
import struct

import pytest

from catenary.virtual import Segment, Servo
from tests.virtual.main_device import STATION, MainDevice
from tests.virtual.servo_drive import (
    CSP,
    CST,
    CSV,
    ENABLE,
    QUICK_STOP,
    SHUTDOWN,
    STATE_MASK,
    SWITCH_ON,
    TURN,
    Drive,
)


@pytest.fixture
def drive() -> Drive:
    return Drive(Servo())


def test_drive_is_enabled_step_by_step(drive: Drive) -> None:
    assert drive.state() & 0x4F == 0x40
    for drive.word, expected in ((SHUTDOWN, 0x21), (SWITCH_ON, 0x23), (ENABLE, 0x27)):
        assert drive.state() == expected
    assert drive.cycle().status & 0x1000
    drive.word = SWITCH_ON
    assert drive.state() == 0x23
    drive.word = 0
    assert drive.state() & 0x4F == 0x40


def test_enable_from_disabled_is_ignored(drive: Drive) -> None:
    drive.word = ENABLE
    assert drive.state() & 0x4F == 0x40


def test_csp_follows_a_sine(drive: Drive) -> None:
    drive.enable(CSP)
    worst = 0.0
    for k in range(1000):
        angle = math.pi / 2 * (1 - math.cos(2 * math.pi * k / 1000))
        drive.position = round(angle * TURN / (2 * math.pi))
        inputs = drive.cycle()
        worst = max(worst, abs(inputs.position - drive.position) / TURN * 2 * math.pi)
    assert worst < 0.03  # two cycles of delay at 9.9 rad/s
    assert abs(drive.servo.position_rad) < 1e-3


def test_csv_reaches_the_velocity(drive: Drive) -> None:
    drive.enable(CSV)
    drive.velocity = 2 * TURN
    inputs = drive.cycle(300)
    assert inputs.velocity == pytest.approx(2 * TURN, rel=1e-3)
    assert drive.servo.velocity_rad_s == pytest.approx(4 * math.pi, rel=1e-3)


def test_cst_acceleration_is_torque_over_inertia() -> None:
    drive = Drive(Servo(inertia=1e-3, viscous_friction=0, coulomb_friction=0))
    drive.enable(CST)
    drive.torque = 100  # a tenth of 2 N·m
    drive.cycle(101)
    assert drive.servo.torque_nm == pytest.approx(0.2)
    assert drive.servo.velocity_rad_s == pytest.approx(0.2 / 1e-3 * 0.1, rel=0.02)


def test_dry_friction_holds_a_motor() -> None:
    drive = Drive(Servo(coulomb_friction=0.1))
    drive.enable(CST)
    drive.torque = 40  # 0.08 N·m
    drive.cycle(100)
    assert drive.servo.velocity_rad_s == 0


def test_torque_is_limited() -> None:
    drive = Drive(Servo(max_torque_ratio=0.5))
    drive.enable(CST)
    drive.torque = 2000
    assert drive.cycle(3).torque == 500


def test_csp_jump_causes_a_following_error(drive: Drive) -> None:
    drive.enable(CSP)
    drive.position += 50 * TURN
    assert drive.cycle(200).status & 0x4F == 0x08
    emergency = drive.main.fetch(STATION)
    assert emergency is not None
    assert emergency[8:10] == b"\x11\x86"
    assert drive.main.upload(STATION, 0x603F, 0) == struct.pack("<H", 0x8611)


def test_fault_is_reset_by_an_edge_after_its_cause_has_ended(drive: Drive) -> None:
    drive.enable(CSP)
    drive.servo.inject_fault(0x2310)
    assert drive.cycle(50).status & 0x4F == 0x08
    drive.word = 0x80
    assert drive.cycle(5).status & 0x4F == 0x08
    drive.servo.inject_fault(0)
    assert drive.cycle(5).status & 0x4F == 0x08
    drive.word = 0
    drive.cycle()
    drive.word = 0x80
    assert drive.cycle(3).status & 0x4F == 0x40


@pytest.mark.parametrize(("option", "end"), [(0, 0x40), (2, 0x40), (6, 0x07)])
def test_quick_stop_follows_its_option_code(option: int, end: int) -> None:
    drive = Drive(Servo())
    drive.main.download(STATION, 0x605A, 0, struct.pack("<h", option))
    drive.enable(CSV)
    drive.velocity = 5 * TURN
    drive.cycle(200)
    drive.word = QUICK_STOP
    status = drive.cycle(2).status
    assert status & 0x4F == (0x40 if option == 0 else 0x07)
    assert drive.cycle(300).status & 0x4F == end
    moving = abs(drive.servo.velocity_rad_s) > 0.1
    assert moving is (option == 0)


def test_sto_removes_the_torque_and_disables_the_drive(drive: Drive) -> None:
    drive.enable(CSP)
    drive.servo.switch_sto(True)
    assert drive.cycle(3).status & 0x5F == 0x40
    assert drive.servo.torque_nm == 0
    drive.servo.switch_sto(False)
    assert drive.cycle(3).status & 0x5F == 0x50
    assert drive.cycle(3).status & 0x4F == 0x40


def test_lost_process_data_stops_the_drive_with_a_fault(drive: Drive) -> None:
    drive.enable(CSV)
    drive.velocity = TURN
    drive.cycle(200)
    drive.main.let_pass(500)
    assert drive.servo.drive_state() == "FAULT"
    assert drive.servo.velocity_rad_s == 0
    assert drive.main.al_status(STATION) == (0x14, 0x001B)


def test_software_limits_stop_csp() -> None:
    drive = Drive(Servo(position_limits=(-1.0, 1.0)))
    drive.enable(CSP)
    for _ in range(300):
        drive.position += 1000
        inputs = drive.cycle()
    assert drive.servo.position_rad == pytest.approx(1.0, abs=1e-3)
    assert inputs.status & 0x0800


def test_positions_wrap_at_32_bits() -> None:
    drive = Drive(Servo())
    drive.servo.move_to(2047.99 * 2 * math.pi)
    drive.enable(CSP)
    start = drive.position
    for k in range(100):
        drive.position = (start + 1000 * k + (1 << 31)) % (1 << 32) - (1 << 31)
        inputs = drive.cycle()
    assert inputs.position < 0 < start
    assert drive.servo.position_rad > 2048 * 2 * math.pi
    assert inputs.status & STATE_MASK == 0x27


def test_unknown_mode_does_not_change_the_display(drive: Drive) -> None:
    drive.enable(CSP)
    drive.mode = 4
    assert drive.cycle(3).mode == CSP


def test_objects_of_the_second_axis_have_an_offset_of_0x800() -> None:
    servo = Servo(axes=2)
    main = MainDevice(Segment([servo]))
    main.number_stations()
    main.start_mailbox(STATION)
    servo.move_to(1.0, axis=1)
    main.let_pass(1)
    expected = round(TURN / (2 * math.pi))
    assert main.upload(STATION, 0x6864, 0) == struct.pack("<i", expected)
    assert main.upload(STATION, 0x6064, 0) == bytes(4)
    assert main.upload(STATION, 0x1C12, 2) == b"\x10\x16"
