"""The devices on the cable differ from those that the program expects.
This is refused before SAFE-OP, with the expected and the found identities.
"""

import pytest

import catenary as cat
from catenary.errors import CatenaryError, IdentityError, MappingError, SegmentError
from catenary.virtual import Coupler, DigitalOutputs, Servo
from catenary.virtual.description import VENDOR_ID
from tests.scenario.cell import PRE_OP, Cell, cell_of

SERVO = (VENDOR_ID, 0x0005_0001)
LAMPS = (VENDOR_ID, 0x0002_0004)


def test_a_wrong_device_is_refused_with_both_identities(cell: Cell) -> None:
    with pytest.raises(IdentityError) as caught:
        cell.main.scan(expected=[None, SERVO, SERVO, SERVO])
    assert caught.value.position == 1
    assert f"0x{SERVO[1]:08X}" in str(caught.value)
    assert f"0x{LAMPS[1]:08X}" in str(caught.value)
    assert all(state <= PRE_OP for state in cell.states)


def test_a_missing_device_is_refused(cell: Cell) -> None:
    with pytest.raises(SegmentError, match="5 devices expected, 4 found"):
        cell.main.scan(expected=[None, LAMPS, SERVO, SERVO, SERVO])
    assert all(state <= PRE_OP for state in cell.states)


def test_the_expected_devices_are_accepted(cell: Cell) -> None:
    cell.main.scan(expected=[None, LAMPS, SERVO, SERVO])
    with cat.Loop(cell.drives()):
        assert set(cell.drive_states) == {"OPERATION ENABLED"}


def test_a_terminal_is_refused_as_a_drive(cell: Cell) -> None:
    with pytest.raises(ValueError, match=r"device 1 \(.*\) is not a drive"):
        cat.Drives([cell.subs[1]], counts_per_turn=1, velocity_limit=100.0, rated_torque=1.0)
    assert all(state <= PRE_OP for state in cell.states)


def test_an_object_the_drive_cannot_map_is_named(cell: Cell) -> None:
    from catenary.drive.objects import AxisObject

    arm = cell.drives(columns=[("heat", AxisObject(0x2FFF, 1, 16))])
    with pytest.raises(MappingError, match="0x2FFF:01"), cat.Loop(arm):
        pytest.fail("entered without an object")
    assert all(state <= PRE_OP for state in cell.states)


def test_a_device_replaced_after_the_scan_is_detected() -> None:
    with cell_of(Coupler(), DigitalOutputs(bits=4), Servo()) as cell:
        arm = cell.drives()
        with cat.Loop(arm):
            pass
        cell.segment.plug(2)  # without the servo
        with pytest.raises(CatenaryError), cat.Loop(arm):
            pytest.fail("entered without its servo")
        assert all(state <= PRE_OP for state in cell.states[:2])
