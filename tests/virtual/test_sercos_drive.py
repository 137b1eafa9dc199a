"""States of a virtual SERCOS drive: control word, status word, operation modes."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.virtual import Coupler, Segment, SercosDrive, _segment
from catenary.virtual.soe.drive_states import DriveStates

ON, ENABLE, POWER, RUN = 0x8000, 0x4000, 0xC000, 0xE000


def test_the_state_machine_of_the_control_word() -> None:
    drive = SercosDrive()
    with cat.MainDevice(Segment([Coupler(), drive])) as main:
        raw = cat.ProcessData(main.scan()[1])
        with cat.Loop(raw) as loop:

            def hold(word: int, cycles: int = 50) -> str:
                raw["S-0-0134"] = word
                raw["S-0-0047"] = raw["S-0-0051"]
                for _ in range(cycles):
                    next(loop)
                assert (
                    drive.status
                    == ("NOT READY", "READY", "POWERED", "OPERATING")[int(raw["S-0-0135"]) >> 14]
                )
                return drive.status

            assert hold(0) == "POWERED"
            assert hold(ON) == "POWERED"
            assert hold(RUN) == "OPERATING"
            assert raw["S-0-0135"] & 0x08
            assert hold(POWER) == "OPERATING"  # drive halt
            assert not raw["S-0-0135"] & 0x08
            assert hold(RUN) == "OPERATING"
            assert hold(ENABLE) == "POWERED"  # drive off
            assert hold(RUN) == "OPERATING"
            assert hold(POWER) == "OPERATING"
            assert hold(ENABLE) == "POWERED"  # drive off after a halt
            assert hold(RUN) == "OPERATING"
            assert hold(ON) == "POWERED"
            assert hold(RUN) == "OPERATING"
            drive.switch_mains(False)
            assert hold(RUN) == "READY"
            drive.switch_mains(True)
            assert hold(0) == "POWERED"
            assert hold(RUN) == "OPERATING"
            drive.switch_sto(True)
            assert hold(RUN) == "READY"
            drive.switch_sto(False)
            assert hold(RUN) == "OPERATING"
            drive.inject_fault(0x7310)
            assert hold(RUN) == "NOT READY"
            assert raw["S-0-0135"] >> 13 & 1
        assert drive.idn_value("S-0-0011") == b"\x00\x80"
        assert b"7310" in drive.idn_value("S-0-0095")


@pytest.mark.parametrize("halted", [False, True])
@pytest.mark.parametrize(
    ("word", "brakes"), [(0x6000, True), (0x4000, True), (ON, False), (0, False)]
)
def test_bit_15_brakes_and_bit_14_removes_the_torque(word: int, brakes: bool, halted: bool) -> None:
    """Without bit 15, the drive brakes before it removes the torque; without bit 14, it coasts."""
    drive = SercosDrive()
    with cat.MainDevice(Segment([Coupler(), drive])) as main:
        sub = main.scan()[1]
        sub.soe.write("S-0-0032", 2)  # velocity mode
        sub.soe.configure_telegrams(mdt=["S-0-0036"], at=["S-0-0040"])
        raw = cat.ProcessData(sub)
        with cat.Loop(raw) as loop:

            def hold(control: int, cycles: int) -> None:
                raw["S-0-0134"] = control
                for _ in range(cycles):
                    next(loop)

            hold(ON, 100)
            raw["S-0-0036"] = 6_000_000  # 600 rpm
            hold(RUN, 500)
            before = drive.velocity_rad_s
            assert before == pytest.approx(62.83, rel=0.01)
            if halted:
                hold(POWER, 20)  # it begins to brake
                assert drive.status == "OPERATING"
                before = drive.velocity_rad_s
                assert before < 60
            hold(word, 10)
            if brakes:
                assert drive.status == "OPERATING"
                assert not raw["S-0-0135"] & 0x08  # it does not follow the command values
                assert drive.velocity_rad_s < before - 5
            else:
                assert drive.status != "OPERATING"
                assert drive.velocity_rad_s > before - 5
            hold(word, 500)
            assert drive.status == "POWERED"
            if brakes:
                assert abs(drive.velocity_rad_s) < 1


def test_a_drive_that_leaves_op_brakes() -> None:
    """Without its MainDevice, the last control word remains, for example after the watchdog."""
    slots = {_segment.SLOT_VELOCITY: 6_000_000, _segment.SLOT_STATUSWORD: 0x1000}
    motor = 4  # OPERATION ENABLED
    states = DriveStates(
        lambda slot: slots.get(slot, 0),
        slots.__setitem__,
        motor_state=lambda: motor,
        operation_mode=lambda _: 2,
        command_changed=lambda: False,
    )
    assert states.step(RUN, in_operation=True) >> 14 == 3
    assert slots[_segment.SLOT_CONTROLWORD] == 0x0F
    assert states.step(RUN, in_operation=False) & 0x08 == 0  # it does not follow
    assert slots[_segment.SLOT_CONTROLWORD] == 0x0B  # quick stop
    slots[_segment.SLOT_VELOCITY], motor = 0, 5  # quick stop active
    states.step(RUN, in_operation=False)
    assert slots[_segment.SLOT_CONTROLWORD] == 0  # without torque


def test_the_operation_mode_is_selected_in_the_control_word() -> None:
    """Bits 8 and 9 select S-0-0033, the velocity mode."""
    drive = SercosDrive()
    with cat.MainDevice(Segment([Coupler(), drive])) as main:
        sub = main.scan()[1]
        sub.soe.configure_telegrams(mdt=["S-0-0036"], at=["S-0-0040", "S-0-0051"])
        raw = cat.ProcessData(sub)
        with cat.Loop(raw) as loop:
            for word in (ON, RUN | 0x100):
                raw["S-0-0134"] = word
                for _ in range(100):
                    next(loop)
            raw["S-0-0036"] = 600_000  # 60 rpm
            for _ in range(500):
                next(loop)
            assert raw["S-0-0135"] >> 8 & 3 == 1
            assert raw["S-0-0040"] == pytest.approx(600_000, rel=0.01)
            assert drive.velocity_rad_s == pytest.approx(6.283, rel=0.01)
