"""Quirks of the virtual servo, and the option codes for stops."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import Segment, Servo, ServoQuirks, read_segment
from catenary.virtual.op_modes import OpMode
from tests.virtual.main_device import STATION, MainDevice
from tests.virtual.servo_drive import (
    CSP,
    CST,
    CSV,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON,
    TURN,
    Drive,
)

BIT_12 = 0x1000
STEP = 250e-6  # [s] internal cycle of the servo
NO_SUCH_OBJECT = 0x0602_0000
INVALID_WATCHDOG_CONFIGURATION = 0x001F
DL_CONTROL, DL_STATUS = 0x0100, 0x0110


def drive_with(**quirks: object) -> Drive:
    return Drive(Servo(quirks=ServoQuirks(**quirks)))  # type: ignore[arg-type]


def turning(drive: Drive) -> Drive:
    """Return a drive in CSV at one turn per second."""
    drive.enable(CSV)
    drive.velocity = TURN
    drive.cycle(200)
    return drive


def parameter(drive: Drive, index: int) -> int:
    data = drive.main.upload(STATION, index, 0)
    assert isinstance(data, bytes)
    return int.from_bytes(data, "little", signed=True)


# -- bit 12 ------------------------------------------------------------------------------------


def test_csp_holds_its_demand_while_bit_12_is_hidden() -> None:
    drive = drive_with()
    drive.enable(CSP)
    for _ in range(50):
        drive.position += 1000
        drive.cycle()
    drive.servo.hide_bit_12(0.01)
    drive.cycle(2)
    demand = parameter(drive, 0x6062)
    target = drive.position
    for _ in range(5):
        drive.position += 1000
        assert not drive.cycle().status & BIT_12
    assert parameter(drive, 0x6062) == demand <= target
    assert drive.cycle(20).status & BIT_12
    assert parameter(drive, 0x6062) == drive.position


@pytest.mark.parametrize("mode", [CSV, CST])
def test_targets_are_ignored_while_bit_12_is_hidden(mode: int) -> None:
    drive = Drive(Servo(coulomb_friction=0.2))
    drive.enable(mode)
    drive.velocity, drive.torque = TURN, 50
    drive.cycle(200)
    velocity, torque = drive.servo.velocity_rad_s, drive.servo.torque_nm
    drive.servo.hide_bit_12(0.1)
    drive.velocity, drive.torque = 0, 0
    drive.cycle(50)
    assert drive.servo.velocity_rad_s == pytest.approx(velocity, abs=1e-3)
    assert drive.servo.torque_nm == pytest.approx(torque, abs=1e-3)
    drive.cycle(300)
    assert abs(drive.servo.velocity_rad_s) < 1e-3


def test_bit_12_can_be_hidden_for_single_steps() -> None:
    drive = drive_with()
    drive.enable(CSP)
    drive.servo.hide_bit_12(4 * STEP)
    shown = [bool(drive.cycle().status & BIT_12) for _ in range(5)]
    assert 1 <= shown.count(False) <= 2
    assert shown[-1]


def test_drive_with_the_quirk_follows_without_bit_12() -> None:
    drive = drive_with(follows_without_bit_12=True)
    drive.enable(CSP)
    drive.servo.hide_bit_12(1.0)
    for _ in range(100):
        drive.position += 1000
        inputs = drive.cycle()
    assert not inputs.status & BIT_12
    assert abs(inputs.position - drive.position) < 5000


def test_drive_that_never_shows_bit_12_can_follow() -> None:
    drive = drive_with(bit_12="never", follows_without_bit_12=True)
    assert turning(drive).cycle().velocity == pytest.approx(TURN, rel=1e-2)
    assert not drive.cycle().status & BIT_12


def test_drive_without_bit_12_holds_its_position() -> None:
    drive = drive_with(bit_12="never")
    drive.enable(CSP)
    drive.position += 10000
    inputs = drive.cycle(50)
    assert not inputs.status & BIT_12
    assert abs(inputs.position) < 10


def test_hide_bit_12_of_a_missing_axis_is_refused() -> None:
    servo = Servo(axes=2)
    Segment([servo])
    with pytest.raises(IndexError, match="no axis 2"):
        servo.hide_bit_12(1.0, axis=2)


# -- stopping ----------------------------------------------------------------------------------


def test_drive_ignores_the_quick_stop() -> None:
    drive = turning(drive_with(ignores_quick_stop=True))
    drive.word = QUICK_STOP
    assert drive.cycle(300).status & 0x6F == 0x27
    assert drive.servo.velocity_rad_s > 6
    drive.word = SWITCH_ON
    assert drive.cycle(300).status & 0x6F == 0x23


def test_drive_that_ignores_both_accepts_disable_voltage() -> None:
    drive = turning(drive_with(ignores_quick_stop=True, ignores_disable=True))
    for drive.word in (QUICK_STOP, SWITCH_ON):
        assert drive.cycle(100).status & 0x6F == 0x27
    drive.word = 0
    assert drive.cycle(2).status & 0x4F == 0x40
    assert drive.servo.torque_nm == 0


def test_drive_that_ignores_disable_accepts_shutdown() -> None:
    drive = turning(drive_with(ignores_disable=True))
    drive.word = SHUTDOWN
    assert drive.cycle(2).status & 0x6F == 0x21


@pytest.mark.parametrize("option", [0, -1, 6])
def test_initial_quick_stop_option(option: int) -> None:
    drive = drive_with(quick_stop_option=option)
    assert parameter(drive, 0x605A) == option


def test_negative_option_disables_the_quick_stop() -> None:
    drive = turning(drive_with(quick_stop_option=-1))
    drive.word = QUICK_STOP
    assert drive.cycle(300).status & 0x6F == 0x27


def test_option_0_removes_the_torque_immediately() -> None:
    drive = turning(drive_with(quick_stop_option=0))
    drive.word = QUICK_STOP
    assert drive.cycle(2).status & 0x4F == 0x40
    assert drive.servo.torque_nm == 0


def test_drive_without_the_option_object_still_ramps() -> None:
    drive = drive_with(quick_stop_option="absent")
    assert drive.main.upload(STATION, 0x605A, 0) == NO_SUCH_OBJECT
    assert drive.main.download(STATION, 0x605A, 0, b"\2\0") == NO_SUCH_OBJECT
    turning(drive)
    drive.word = QUICK_STOP
    assert drive.cycle(2).status & 0x6F == 0x07
    assert drive.cycle(300).status & 0x4F == 0x40


def stopping_time(option: int) -> int:
    """Return the number of cycles from a quick stop at 20 turns per second to standstill."""
    drive = drive_with(quick_stop_option=option)
    drive.enable(CSV)
    drive.velocity = 20 * TURN
    drive.cycle(400)
    drive.word = QUICK_STOP
    count = 0
    while abs(drive.servo.velocity_rad_s) > 0.1:
        drive.cycle()
        count += 1
    return count


def test_options_select_one_of_two_ramps() -> None:
    """0x6084 is half of 0x6085."""
    quick, slow = stopping_time(6), stopping_time(5)
    assert stopping_time(2) == quick
    assert stopping_time(1) == slow
    assert slow > 1.5 * quick


def test_demand_of_a_braking_axis_is_its_position() -> None:
    drive = drive_with(quick_stop_option=6)
    drive.enable(CSP)
    for _ in range(100):
        drive.position += 5000
        drive.cycle()
    drive.word = QUICK_STOP
    drive.cycle(100)
    assert parameter(drive, 0x6062) == parameter(drive, 0x6064) != drive.position


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, "OPERATION ENABLED"),
        (1, "FAULT"),
        (2, "SWITCH ON DISABLED"),
        (3, "SWITCH ON DISABLED"),
    ],
)
def test_reaction_to_the_loss_of_process_data(option: int, state: str) -> None:
    drive = turning(drive_with(abort_connection_option=option))
    assert parameter(drive, 0x6007) == option
    drive.main.let_pass(500)
    assert drive.main.al_status(STATION) == (0x14, 0x001B)
    assert drive.servo.drive_state() == state
    stands = abs(drive.servo.velocity_rad_s) < 0.05
    assert stands is (option != 0)
    emergency = drive.main.fetch(STATION)
    assert (emergency is not None and emergency[8:10] == b"\x00\x75") is (option == 1)


def test_disable_voltage_coasts_and_a_quick_stop_brakes() -> None:
    travelled = {}
    for option in (2, 3):
        drive = turning(drive_with(abort_connection_option=option))
        drive.main.let_pass(100)
        before = drive.servo.position_rad
        drive.main.let_pass(500)
        travelled[option] = drive.servo.position_rad - before
    assert travelled[2] > 10 * travelled[3]


def test_axis_is_not_enabled_after_a_lost_connection() -> None:
    drive = turning(drive_with(abort_connection_option=3, quick_stop_option=6))
    drive.main.let_pass(1000)
    assert drive.servo.drive_state() == "QUICK STOP ACTIVE"


def test_the_abort_option_can_be_written() -> None:
    drive = drive_with()
    assert drive.main.download(STATION, 0x6007, 0, struct.pack("<h", 2)) == 0
    assert parameter(drive, 0x6007) == 2


# -- modes -------------------------------------------------------------------------------------


def test_old_mode_stays_active_during_the_mode_delay() -> None:
    drive = turning(drive_with(mode_delay=0.02))
    drive.mode, drive.torque = CST, 0
    assert drive.cycle(15).mode == CSV
    drive.velocity = 2 * TURN
    drive.cycle(3)
    assert drive.servo.velocity_rad_s > 8
    assert drive.cycle(10).mode == CST
    assert drive.servo.torque_nm == 0


def test_withdrawn_mode_request_restarts_the_delay() -> None:
    drive = turning(drive_with(mode_delay=0.02))
    for drive.mode in (CST, CSV, CST, CSV, CST):
        assert drive.cycle(10).mode == CSV
    assert drive.cycle(15).mode == CST


def test_refused_mode_is_never_shown() -> None:
    drive = turning(drive_with(refused_modes=(CST,)))
    drive.mode = CST
    assert drive.cycle(500).mode == CSV
    assert drive.servo.velocity_rad_s > 6
    drive.mode = CSP
    drive.position = drive.cycle().position
    assert drive.cycle(3).mode == CSP


# -- watchdog ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("trigger", "control"), [(True, 0x64), (False, 0x24)])
def test_sii_shows_the_watchdog_trigger_bit(trigger: bool, control: int) -> None:
    servo = Servo(quirks=ServoQuirks(watchdog_trigger=trigger))
    outputs = servo.description().sync_managers[2]
    assert outputs.control == control


def test_watchdog_never_expires_without_the_trigger_bit() -> None:
    drive = Drive(Servo(), control=0x24)
    turning(drive)
    drive.main.let_pass(1000)
    assert drive.servo.drive_state() == "OPERATION ENABLED"
    assert drive.servo.velocity_rad_s > 6


@pytest.mark.parametrize(
    ("control", "time", "code"),
    [
        (0x64, 1000, 0),
        (0x24, 0, 0),
        (0x24, 1000, INVALID_WATCHDOG_CONFIGURATION),
        (0x64, 0, INVALID_WATCHDOG_CONFIGURATION),
    ],
)
def test_device_checks_its_watchdog_configuration(control: int, time: int, code: int) -> None:
    main = MainDevice(Segment([Servo(quirks=ServoQuirks(checks_watchdog=True))]))
    main.number_stations()
    main.let_pass(30)
    main.map_servo(STATION, 0, control=control)
    main.write(STATION, 0x0420, struct.pack("<H", time))
    assert main.request(STATION, 4) == ((0x12, code) if code else (4, 0))


# -- the options -------------------------------------------------------------------------------


def test_quirks_are_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "segment.toml"
    path.write_text(
        '[[device]]\nkind = "servo"\n'
        'quirks = { bit_12 = "never", quick_stop_option = -1, refused_modes = [10] }\n'
    )
    [servo] = read_segment(path)
    assert isinstance(servo, Servo)
    assert servo.quirks == ServoQuirks(bit_12="never", quick_stop_option=-1, refused_modes=(10,))
    path.write_text('[[device]]\nkind = "servo"\nquirks = { mode_delay = -1.0 }\n')
    with pytest.raises(ConfigurationError, match="mode_delay must be at least 0 s"):
        read_segment(path)


@pytest.mark.parametrize(
    ("quirk", "value"),
    [
        ("mode_delay", -0.1),
        ("refused_modes", (1,)),
        ("quick_stop_option", 40000),
        ("abort_connection_option", 4),
    ],
)
def test_invalid_servo_quirks_are_refused(quirk: str, value: object) -> None:
    with pytest.raises(ValueError, match=quirk):
        ServoQuirks(**{quirk: value})  # type: ignore[arg-type]


def test_clock_quirks_are_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(
        '[[device]]\nkind = "servo"\n[device.quirks]\nsync_signal = "sync1"\ncloses_ports = false\n'
        '[[device.quirks.op_modes]]\nname = "DC"\nassign_activate = 0x0500\nshift_ns = -1000\n'
    )
    [servo] = read_segment(path)
    assert isinstance(servo, Servo)
    assert servo.quirks == ServoQuirks(
        op_modes=(OpMode(name="DC", assign_activate=0x0500, shift_ns=-1000),),
        sync_signal="sync1",
        closes_ports=False,
    )


def test_port_that_ignores_loop_control_stays_open() -> None:
    main = MainDevice(Segment([Servo(quirks=ServoQuirks(closes_ports=False)), Servo()]))
    for _ in range(2):  # also after a power cycle
        main.number_stations()
        main.write(STATION, DL_CONTROL, struct.pack("<I", 0x0007_0C01))  # port 1 closed
        assert main.read(STATION, DL_STATUS, 2)[1] & 0x04 == 0
        assert main.read(STATION + 1, DL_STATUS, 2)
        main.segment[0].switch_off()
        main.segment[0].switch_on()


def test_quirks_survive_a_power_cycle() -> None:
    drive = drive_with(ignores_quick_stop=True, abort_connection_option=2)
    drive.servo.switch_off()
    drive.servo.switch_on()
    main = drive.main
    main.number_stations()
    main.let_pass(30)
    main.start_servo(STATION, 0)
    assert main.upload(STATION, 0x6007, 0) == b"\2\0"
    drive.word, drive.velocity = 0, 0
    drive.cycle()
    assert main.request(STATION, 8) == (8, 0)
    turning(drive)
    drive.word = QUICK_STOP
    assert drive.cycle(50).status & 0x6F == 0x27
