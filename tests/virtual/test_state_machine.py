"""AL state machine: refusals and their codes, acknowledgement, faults and emulation."""

from __future__ import annotations

import pytest

from catenary.virtual import Coupler, Segment, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import STATION, MainDevice

INIT, PRE_OP, BOOT, SAFE_OP, OP = 1, 2, 3, 4, 8
ERROR = ACKNOWLEDGE = 0x10


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([Servo()]))
    main.number_stations()
    return main


def servo_of(main: MainDevice) -> Servo:
    servo = main.segment[0]
    assert isinstance(servo, Servo)
    return servo


@pytest.mark.parametrize(
    ("state", "code"),
    [(OP, 0x0011), (SAFE_OP, 0x0011), (BOOT, 0x0013), (0x0F, 0x0012), (0, 0x0012)],
)
def test_invalid_requests_from_init_are_refused(main: MainDevice, state: int, code: int) -> None:
    assert main.request(STATION, state) == (INIT | ERROR, code)


def test_error_is_kept_until_acknowledged(main: MainDevice) -> None:
    main.sync_manager(STATION, 0, 0x1000, 128, 0x26)
    main.sync_manager(STATION, 1, 0x1080, 128, 0x22)
    assert main.request(STATION, OP) == (INIT | ERROR, 0x0011)
    assert main.request(STATION, PRE_OP) == (INIT | ERROR, 0x0011)
    assert main.request(STATION, PRE_OP | ACKNOWLEDGE) == (PRE_OP, 0)


def test_init_needs_no_acknowledgement(main: MainDevice) -> None:
    """SSC, ecatslv.c, AL_ControlInd; SOES, esc.c, ESC_state."""
    main.start_servo(STATION, 0)
    assert main.request(STATION, BOOT) == (SAFE_OP | ERROR, 0x0013)
    assert main.request(STATION, SAFE_OP) == (SAFE_OP | ERROR, 0x0013)
    assert main.request(STATION, INIT) == (INIT, 0)


@pytest.mark.parametrize("requested", [INIT, PRE_OP, SAFE_OP])
def test_local_error_does_not_replace_a_request_for_a_lower_state(
    main: MainDevice, requested: int
) -> None:
    """IgH stops its cycle and requests INIT. The watchdog expires before INIT is reached."""
    main.start_servo(STATION, 0)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    assert main.request(STATION, OP) == (OP, 0)
    servo_of(main).delay_state(requested, 0.15)  # the watchdog expires after 100 ms
    main.request(STATION, requested)
    main.let_pass(120)
    assert main.al_status(STATION) == (SAFE_OP | ERROR, 0x001B)
    main.let_pass(60)
    assert main.al_status(STATION) == (requested, 0)


def test_local_error_cancels_a_request_for_a_higher_state(main: MainDevice) -> None:
    main.start_servo(STATION, 0)
    servo_of(main).delay_state(OP, 0.01)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    main.request(STATION, OP)
    servo_of(main).application.states.fail(SAFE_OP, 0x001A)
    main.let_pass(100)
    assert main.al_status(STATION) == (SAFE_OP | ERROR, 0x001A)


def test_mailbox_that_differs_from_the_sii_is_refused(main: MainDevice) -> None:
    assert main.request(STATION, PRE_OP) == (INIT | ERROR, 0x0016)
    main.sync_manager(STATION, 0, 0x1000, 64, 0x26)
    main.sync_manager(STATION, 1, 0x1080, 128, 0x22)
    assert main.request(STATION, PRE_OP | ACKNOWLEDGE) == (INIT | ERROR, 0x0016)


def test_process_data_with_a_wrong_length_is_refused(main: MainDevice) -> None:
    main.start_mailbox(STATION)
    main.sync_manager(STATION, 2, 0x1100, 12, 0x64)
    assert main.request(STATION, SAFE_OP) == (PRE_OP | ERROR, 0x001D)
    main.write(STATION, 0x0816, b"\x00")
    main.sync_manager(STATION, 2, 0x1100, 13, 0x64)
    assert main.request(STATION, SAFE_OP | ACKNOWLEDGE) == (PRE_OP | ERROR, 0x001E)
    main.sync_manager(STATION, 3, 0x2000, 13, 0x20)
    assert main.request(STATION, SAFE_OP | ACKNOWLEDGE) == (SAFE_OP, 0)


def test_op_requires_outputs(main: MainDevice) -> None:
    main.start_servo(STATION, 0)
    assert main.request(STATION, OP) == (SAFE_OP, 0)
    main.let_pass(300)
    assert main.al_status(STATION) == (SAFE_OP | ERROR, 0x0019)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    assert main.request(STATION, OP | ACKNOWLEDGE) == (OP, 0)


def test_late_outputs_complete_the_transition_to_op(main: MainDevice) -> None:
    main.start_servo(STATION, 0)
    main.request(STATION, OP)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    main.let_pass(1)
    assert main.al_status(STATION) == (OP, 0)


def test_missing_process_data_in_op_is_a_watchdog_error(main: MainDevice) -> None:
    main.start_servo(STATION, 0)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    assert main.request(STATION, OP) == (OP, 0)
    main.let_pass(150)
    assert main.al_status(STATION) == (SAFE_OP | ERROR, 0x001B)
    assert main.read(STATION, 0x0440, 1)[0] & 1 == 0
    assert main.read(STATION, 0x0442, 1) == b"\x01"


def test_lower_states_are_reached_in_one_step(main: MainDevice) -> None:
    main.start_servo(STATION, 0)
    main.exchange_logical(EcatCommand.LRW, 0, bytes(26))
    main.request(STATION, OP)
    assert main.request(STATION, INIT) == (INIT, 0)
    assert main.exchange_logical(EcatCommand.LRW, 0, bytes(26)).working_counter == 0


def test_injected_refusal_and_delay(main: MainDevice) -> None:
    servo_of(main).refuse_state(PRE_OP, 0x8001)
    main.sync_manager(STATION, 0, 0x1000, 128, 0x26)
    main.sync_manager(STATION, 1, 0x1080, 128, 0x22)
    assert main.request(STATION, PRE_OP) == (INIT | ERROR, 0x8001)
    servo_of(main).refuse_state(PRE_OP, None)
    servo_of(main).delay_state(PRE_OP, 0.5)
    assert main.request(STATION, PRE_OP | ACKNOWLEDGE)[0] & 0x0F == INIT
    main.let_pass(500)
    assert main.al_status(STATION) == (PRE_OP, 0)
    servo_of(main).delay_state(SAFE_OP, None)
    main.request(STATION, SAFE_OP)
    main.let_pass(10_000)
    assert main.al_status(STATION) == (PRE_OP, 0)


def test_emulated_device_copies_the_error_bit() -> None:
    # as the EK1100 and EL1004 in ecrab_soem-sdinfo-ek1100-el1004: 0x11 requested, 0x11 shown
    main = MainDevice(Segment([Coupler()]))
    main.number_stations()
    assert main.request(STATION, 0x11) == (0x11, 0)
    assert main.request(STATION, OP) == (OP, 0)
