"""OpModes of real devices: SYNC1 once per period with a faster SYNC0, SYNC1 alone, and a shift of
two seconds in the EEPROM of an EasyCAT.
The error names the last device of a ring that cannot close its port.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.errors import ClockError, ConfigurationError, StateError
from catenary.virtual import Coupler, Segment, Servo, ServoQuirks
from catenary.virtual.op_modes import EASYCAT, EL3702, SYNC1_ALONE, OpMode
from tests.scenario.cell import OP, Cell, cell_of
from tests.scenario.clocked import run_for

DRIVE = 1


@contextmanager
def cell_with(*op_modes: OpMode, by_sync1: bool = False) -> Iterator[Cell]:
    signal = "sync1" if by_sync1 else "sync0"
    quirks = ServoQuirks(op_modes=op_modes, sync_signal=signal)  # type: ignore[arg-type]
    with cell_of(Coupler(), Servo(quirks=quirks)) as cell:
        yield cell


def pulses_of_a_second(cell: Cell, dc: cat.DistributedClock | bool) -> tuple[int, int]:
    """Return the SYNC0 and SYNC1 pulses in 1000 periods. The device stays synchronised in OP."""
    core = cell.segment.core
    with cat.Loop(cell.drives(dc=dc), period=1e-3) as loop:
        loop.wait_locked()
        before = core.pulses(DRIVE)
        run_for(loop, 1.0)
        after = core.pulses(DRIVE)
        assert cell.states == [OP, OP]
        assert core.synchronous(DRIVE) == (True, True, 0, 0, 0, False)
    return after[0] - before[0], after[1] - before[1]


def test_sync1_once_per_period_with_a_faster_sync0() -> None:
    with cell_with(*EL3702, by_sync1=True) as cell:
        sync0, sync1 = pulses_of_a_second(cell, cat.DistributedClock(op_mode="DcSync4"))
        assert sync0 == pytest.approx(4000, abs=8)
        assert sync1 == pytest.approx(1000, abs=2)


def test_the_period_of_sync0_can_be_given() -> None:
    with cell_with(*EL3702, by_sync1=True) as cell:
        clock = cat.DistributedClock(op_mode="DcSync4", sync0=5e-4)
        sync0, sync1 = pulses_of_a_second(cell, clock)
        assert sync0 == pytest.approx(2000, abs=4)
        assert sync1 == pytest.approx(1000, abs=2)


@pytest.mark.parametrize(
    "dc",
    [
        True,
        cat.DistributedClock(op_mode="DcSync250us"),
        cat.DistributedClock(assign_activate=0x0500, shift=0.0),
    ],
)
def test_sync1_alone(dc: cat.DistributedClock | bool) -> None:
    with cell_with(*SYNC1_ALONE, by_sync1=True) as cell:
        sync0, sync1 = pulses_of_a_second(cell, dc)
        assert sync0 == 0
        assert sync1 == pytest.approx(1000, abs=2)


def test_a_drive_with_sync1_alone_refuses_sync0() -> None:
    with cell_with(*SYNC1_ALONE, by_sync1=True) as cell:
        drives = cell.drives(dc=cat.DistributedClock(assign_activate=0x0300))
        with pytest.raises(StateError) as refused, cat.Loop(drives, period=1e-3):
            raise AssertionError("the drive must not leave PRE-OP")
        assert refused.value.code == 0x0030


def test_an_implausible_shift_is_reported_as_that_of_the_eeprom() -> None:
    with cell_with(*EASYCAT) as cell:
        with (
            pytest.raises(ConfigurationError, match=r"its EEPROM .*'DC_Sync'.* shift of 2 s") as no,
            cat.Loop(cell.drives(dc=True), period=1e-3),
        ):
            raise AssertionError("the loop was opened")
        assert "cat.DistributedClock(shift=0.0)" in no.value.hint
        sync0, sync1 = pulses_of_a_second(cell, cat.DistributedClock(shift=0.0))
        assert (sync0, sync1) == (pytest.approx(1000, abs=2), 0)


def test_the_error_for_an_unknown_op_mode_lists_those_of_the_device() -> None:
    with cell_with(*EL3702) as cell:
        drives = cell.drives(dc=cat.DistributedClock(op_mode="DcSync8"))
        with (
            pytest.raises(ConfigurationError, match="it has 'FreeRun', 'DC Sync0', 'DcSync4'"),
            cat.Loop(drives, period=1e-3),
        ):
            raise AssertionError("the loop was opened")


def test_the_plan_shows_the_op_mode() -> None:
    with cell_with(*EL3702, by_sync1=True) as cell:
        drives = cell.drives(dc=cat.DistributedClock(op_mode="dcsync4"))
        text = str(cell.main.plan(drives, period=1e-3))
        assert "SYNC0 every 250 us, -10 us after the common SYNC0 time, SYNC1 750 us later" in text
        assert "AssignActivate 0x0730, OpMode 'DcSync4'" in text


def test_a_ring_whose_port_cannot_be_closed_is_refused() -> None:
    last = Servo(quirks=ServoQuirks(closes_ports=False))
    segment = Segment([Coupler(), Servo(), last], ring=True)
    with cat.MainDevice(segment.first, segment.second) as main:
        drives = cat.Drives(
            main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0, dc=True
        )
        with (
            pytest.raises(ClockError, match=r"device 2 .*port 1, .* cannot be closed") as refused,
            cat.Loop(drives, period=1e-3),
        ):
            raise AssertionError("the delays of this ring cannot be measured")
        assert "processor" not in str(refused.value)
        assert "use a line" in refused.value.hint
