"""The process is killed, or its machine crashes: nobody says goodbye.
The watchdogs, set from the plan, take the outputs down and the drives stop by themselves.
The next process finds the segment as it is and starts anew.
"""

import signal
import subprocess
import sys
import time
from collections.abc import Callable

import catenary as cat
from catenary.virtual import Coupler, DigitalOutputs, Segment, Server, Servo
from tests.scenario.cell import Cell

WATCHDOG = 0.1  # [s], the default of Loop
# In real time: the machine may stop for a while without the scenario being over.
PATIENT = "period=2e-3, watchdog=1.0, lost_limit=1000, late_limit=0"

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


def test_without_frames_the_watchdog_takes_everything_down(cell: Cell) -> None:
    arm, lamps = cell.drives(), cat.Outputs(cell.subs[1])
    with cat.Loop(arm, lamps) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 5.0 * cycle.time
            lamps.bits[:] = 1
            if cycle.number == 200:
                break
        assert cell.segment[1].outputs == 0b1111  # type: ignore[attr-defined]
        loop._opened.engine.stop()  # as if the process were gone: no more frames
        cell.let_pass(WATCHDOG / 2)
        assert cell.segment[1].outputs == 0b1111  # type: ignore[attr-defined]
        cell.let_pass(WATCHDOG)
        assert cell.segment[1].outputs == 0  # type: ignore[attr-defined]
        cell.let_pass(0.2)
        assert "OPERATION ENABLED" not in cell.drive_states
        assert all(abs(servo.velocity_rad_s) < 0.05 for servo in cell.servos)
        loop._opened.engine.start()  # so that leaving finds what it expects
    cell.assert_safe()


def until(condition: Callable[[], bool], seconds: float) -> bool:
    """Whether it comes true in real time."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.005)  # real time, over a real wire: there is no virtual clock to wait on
    return False


def test_a_killed_process_leaves_nothing_turning_and_nothing_locked(veth: tuple[str, str]) -> None:
    lamps, servo = DigitalOutputs(), Servo()
    segment = Segment([Coupler(), lamps, servo], clock="monotonic")
    with (
        Server(segment, veth[1]),
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
            arm = cat.Drives(main.scan().drives, counts_per_turn=2**20)
            with cat.Loop(arm, period=2e-3, watchdog=1.0, lost_limit=1000, late_limit=0) as loop:
                next(loop)
                assert servo.drive_state() == "OPERATION ENABLED"
