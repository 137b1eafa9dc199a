"""Errors of bad cycles name the device."""

from catenary.loop.cycle_errors import (
    AxisTrouble,
    Evidence,
    drive_error,
    silence_error,
    state_error,
)
from catenary.procedure.al_status_poll import Answer
from catenary.procedure.station import Station
from catenary.wire.al import AlState
from catenary.wire.cia402 import AxisState

COUPLER = Station(0, 0x1000, "Coupler")
SERVO = Station(1, 0x1001, "Servo")
LAMP = Station(2, 0x1002, "Lamp")
LOG = object()


def test_silent_devices_are_named() -> None:
    answers = [Answer(COUPLER, AlState.OP), Answer(SERVO, None), Answer(LAMP, None)]
    error = silence_error(Evidence(answers), [1, 2], 3, LOG)
    assert "device 1 (Servo), device 2 (Lamp)" in str(error)
    assert error.log is LOG


def test_silence_of_all_devices_suggests_the_first_cable() -> None:
    error = silence_error(Evidence([Answer(COUPLER, None), Answer(SERVO, None)]), [1], 3, LOG)
    assert "no device answers" in str(error)


def test_a_returned_device_is_reported_as_not_in_op() -> None:
    answers = [Answer(COUPLER, AlState.OP), Answer(SERVO, AlState.INIT)]
    assert "device 1 (Servo) is in INIT" in str(silence_error(Evidence(answers), [1], 3, LOG))


def test_lost_frames_without_a_silent_device() -> None:
    answers = [Answer(COUPLER, AlState.OP), Answer(SERVO, AlState.OP)]
    error = silence_error(Evidence(answers), [1], 5, LOG)
    assert str(error).startswith("5 cycles in a row")
    assert "frames are lost" in error.hint


def test_a_device_that_left_op_is_reported_with_its_reason() -> None:
    answers = [Answer(COUPLER, AlState.OP), Answer(SERVO, AlState.SAFE_OP | 0x10, 0x001B)]
    error = state_error(answers, LOG)
    assert error is not None
    assert (error.position, error.requested, error.actual, error.code) == (1, 8, 4, 0x001B)
    assert "device 1 (Servo) is in SAFE-OP with an error" in str(error)
    assert "0x001B" in str(error)


def test_a_state_left_without_a_reason_suspects_a_second_master() -> None:
    error = state_error([Answer(SERVO, AlState.PRE_OP)], LOG)
    assert error is not None
    assert "check for a second master" in error.hint


def test_a_visible_second_master_is_named() -> None:
    answers = [Answer(SERVO, AlState.SAFE_OP | 0x10, 0x001B)]
    error = state_error(answers, LOG, ["PID 42 (scan) has an EtherCAT packet socket on eth0"])
    assert error is not None
    assert "PID 42 (scan)" in error.hint


def test_no_error_if_all_devices_are_in_op() -> None:
    assert state_error([Answer(COUPLER, AlState.OP), Answer(SERVO, AlState.OP)], LOG) is None


def test_others_that_left_op_are_noted() -> None:
    answers = [Answer(SERVO, AlState.SAFE_OP), Answer(LAMP, AlState.PRE_OP)]
    error = state_error(answers, LOG)
    assert error is not None
    assert error.__notes__ == ["also: device 2 (Lamp) is in PRE-OP"]


def test_a_fault_is_reported_with_its_code() -> None:
    error = drive_error([AxisTrouble("1 Servo", AxisState.FAULT, 0x8611)], "in fault", LOG)
    assert "0x8611 (following error)" in str(error)
    assert "resets the fault" in error.hint


def test_a_drive_without_power_is_not_in_fault() -> None:
    trouble = AxisTrouble("1 Servo", AxisState.SWITCH_ON_DISABLED, None)
    error = drive_error([trouble], "cannot be enabled", LOG)
    assert "supply" in error.hint
