"""The process is killed, or its machine crashes, without a shutdown of the devices.
The watchdogs, set from the plan, switch the outputs off, and the drives stop by themselves.
The next process finds the segment in this state and starts normally.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.virtual import Coupler, DigitalOutputs, Segment, Server, Servo, ServoQuirks
from tests.scenario.cell import KINDS, Cell, cell_of, cell_with
from tests.scenario.vertical import VerticalCell, vertical_cell

WATCHDOG = 0.1  # [s], the default of Loop
# In real time: the machine may stall for a while without a failure of the scenario.
PATIENT = "period=2e-3, watchdog=1.0, stop=cat.StopPolicy(lost_limit=1000, late_limit=0)"

SCRIPT = f"""
import sys
import catenary as cat

with cat.MainDevice(sys.argv[1]) as main:
    subs = main.scan()
    lamps = cat.Outputs(subs[1])
    arm = cat.Drives(subs.drives, counts_per_turn=2**20)
    with cat.Loop(lamps, arm, {PATIENT}) as loop:
        for cycle in loop:
            lamps.bits[:] = 1
            arm.target.position[:] += 0.01
            if cycle.number == 50:
                print("running", flush=True)
"""


@pytest.fixture(params=KINDS)
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    """Yield a cell with drives of each kind."""
    with cell_with(request.param) as cell:
        yield cell


def test_without_frames_the_watchdogs_stop_all_devices(cell: Cell) -> None:
    arm, lamps = cell.drives(), cat.Outputs(cell.subs[1])
    with cat.Loop(arm, lamps) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 5.0 * cycle.time
            lamps.bits[:] = 1
            if cycle.number == 200:
                break
        assert cell.segment[1].outputs == 0b1111  # type: ignore[attr-defined]
        loop._opened.engine.stop()  # as after a kill: no more frames
        cell.let_pass(WATCHDOG / 2)
        assert cell.segment[1].outputs == 0b1111  # type: ignore[attr-defined]
        cell.let_pass(WATCHDOG)
        assert cell.segment[1].outputs == 0  # type: ignore[attr-defined]
        cell.let_pass(0.2)
        assert "OPERATION ENABLED" not in cell.drive_states
        assert all(abs(servo.velocity_rad_s) < 0.05 for servo in cell.servos)
        loop._opened.engine.start()  # so that the loop can be left
    cell.assert_safe()


@pytest.mark.parametrize("checks_watchdog", [False, True])
def test_a_drive_stops_although_its_sii_lacks_the_watchdog_trigger(checks_watchdog: bool) -> None:
    """The control byte is 0x24. With `checks_watchdog`, the SII value would be refused."""
    quirks = ServoQuirks(watchdog_trigger=False, checks_watchdog=checks_watchdog)
    with cell_of(Coupler(), Servo(quirks=quirks)) as cell:
        arm = cell.drives()
        with cat.Loop(arm) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 5.0 * cycle.time
                if cycle.number == 200:
                    break
            assert cell.drive_states == ["OPERATION ENABLED"]
            loop._opened.engine.stop()
            cell.let_pass(WATCHDOG + 0.2)
            assert cell.drive_states == ["FAULT"]
            loop._opened.engine.start()
        cell.assert_safe()


def kill_in_cst(cell: VerticalCell, watchdog: float) -> tuple[float, float]:
    """Kill the process while the arm is lifted by 10 N·m more than its load.

    Returns the distance until the arm stands [rad], and the velocity at the kill [rad/s].
    """
    arm = cell.drives(mode="cst", velocity_limit=6.0)
    with cat.Loop(arm, watchdog=watchdog, stop=cat.StopPolicy(raise_faults=False)) as loop:
        for cycle in loop:
            arm.target.torque[:] = cell.gravity + 10.0
            if cycle.number == 50:
                break
        before, velocity = cell.joint, cell.velocity
        loop._opened.engine.stop()
        cell.let_pass(1.0)
        assert not cell.powered
        assert abs(cell.velocity) < 1e-3
        loop._opened.engine.start()
    return cell.joint - before, velocity


@pytest.mark.parametrize("watchdog", [0.010, 0.100])
def test_a_stale_torque_lasts_as_long_as_the_watchdog(watchdog: float) -> None:
    """The upward bound is the distance in the watchdog's time plus the drive's ramp (0x6085). The
    downward bound is the fall until the brake has closed."""
    with vertical_cell() as cell:
        travelled, velocity = kill_in_cst(cell, watchdog)
        acceleration = cell.g_eff * 10.0 / cell.gravity
        seconds = watchdog + 2e-3  # the last frame, and the device's service
        reached = velocity + acceleration * seconds
        accelerated = velocity * seconds + 0.5 * acceleration * seconds**2
        ramp = 1000.0 / 50.0  # rad/s² at the joint
        assert velocity > 0.1
        assert -cell.fall_bound(reaction=0) < travelled
        assert travelled < accelerated + reached**2 / (2 * ramp) + 0.005
        assert travelled > 0.9 * accelerated - cell.fall_bound(reaction=0)


def until(condition: Callable[[], bool], seconds: float) -> bool:
    """Return True if a condition becomes true in real time."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.005)  # real time over a real wire, without a virtual clock
    return False


def test_after_a_kill_no_drive_turns_and_no_lock_is_held(veth: tuple[str, str]) -> None:
    lamps, servo = DigitalOutputs(), Servo()
    segment = Segment([Coupler(), lamps, servo], clock="monotonic")
    with (
        Server(segment, veth[1], max_age=None),
        subprocess.Popen(
            [sys.executable, "-c", SCRIPT, veth[0]], stdout=subprocess.PIPE, text=True
        ) as child,
    ):
        assert child.stdout is not None
        assert child.stdout.readline().strip() == "running"
        assert lamps.outputs == 0b1111
        assert servo.drive_state() == "OPERATION ENABLED"
        child.send_signal(signal.SIGKILL)
        child.wait()
        assert until(lambda: lamps.outputs == 0, seconds=30)
        assert until(lambda: servo.drive_state() != "OPERATION ENABLED", seconds=30)
        assert until(lambda: abs(servo.velocity_rad_s) < 0.05, seconds=30)
        with cat.MainDevice(veth[0]) as main:
            arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            with cat.Loop(
                arm, period=2e-3, watchdog=1.0, stop=cat.StopPolicy(lost_limit=1000, late_limit=0)
            ) as loop:
                next(loop)
                assert servo.drive_state() == "OPERATION ENABLED"
