"""An arm on a vertical axis changes between CST and CSP while it is powered, on drives that take
their time or refuse. Until 0x6061 shows the new mode, the old one counts as hand-over.
No frame carries 0 N·m while the drive works in CST.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary import events
from catenary.plan.stop_reason import StopReason
from catenary.virtual import ServoQuirks
from tests.scenario.frames import SentOutputs, sent_to_axis
from tests.scenario.vertical import MS, RESOLUTION, follow, vertical_cell

CSP, CSV, CST = 8, 9, 10
HANDOVER, MODE_TIMEOUT = 20, 100  # ms
LOAD_RAW = 500  # per mille


def requested(sent: list[SentOutputs], mode: int) -> list[SentOutputs]:
    """Return the frames from the first one that requests `mode` on."""
    return sent[next(k for k, each in enumerate(sent) if each.mode == mode) :]


@pytest.mark.parametrize("delay", [0.0, 0.010])
def test_cst_to_csp_keeps_the_torque(delay: float, tmp_path: Path) -> None:
    """Bound: none falls, but for the play of the position loop that takes the load over."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(quirks=ServoQuirks(mode_delay=delay), record=recording) as cell:
        arm = cell.drives(mode="cst", other_modes=["csp"], velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            follow(cell, arm, loop, 100)
            arm.switch("csp")
            before = cell.joint
            trace = cell.compute(next(loop), 0.04)
            follow(cell, arm, loop, 200)
            assert arm.enabled.all()
            assert arm.actual.mode[0] == CSP
        assert trace.powered.all()
        assert trace.fall(before) < 2 * RESOLUTION
    shown = round(delay / MS)
    assert {each.torque for each in requested(sent_to_axis(recording, plan), CSP)[:shown]} <= {
        LOAD_RAW
    }


@pytest.mark.parametrize("delay", [0.0, 0.010, 0.050])
@pytest.mark.parametrize("columns", [[], ["torque_demand"]])
def test_csp_to_cst_never_sends_zero_torque(
    delay: float, columns: list[str], tmp_path: Path
) -> None:
    """Bound: the fall of the torque's play while the application takes over."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(quirks=ServoQuirks(mode_delay=delay), record=recording) as cell:
        arm = cell.drives(
            mode="csp",
            other_modes=["cst"],
            velocity_limit=6.0,
            columns=columns,
        )
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            follow(cell, arm, loop, 300)
            arm.switch("cst")
            before = lowest = cell.joint
            for cycle in loop:
                lowest = min(lowest, cell.joint)
                arm.target.torque[:] = arm.target.torque  # whatever is sent now stays
                if arm.actual.mode[0] == CST and arm.enabled.all():
                    arm.target.torque[:] = cell.gravity
                if cycle.number > 700:
                    break
            assert arm.actual.mode[0] == CST
        assert before - lowest < RESOLUTION * 2
    sent = requested(sent_to_axis(recording, plan), CST)
    powered = [each.torque for each in sent if each.controlword == 0x0F]
    assert min(powered) > 0.8 * LOAD_RAW


def test_a_change_that_takes_too_long_in_cst_is_a_quick_stop(tmp_path: Path) -> None:
    """Bound: the torque carries the load meanwhile; the fall until the brake has closed."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(quirks=ServoQuirks(mode_delay=0.060), record=recording) as cell:
        arm = cell.drives(mode="cst", other_modes=["csp"], velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            plan = loop.plan.cycle
            follow(cell, arm, loop, 100)
            arm.switch("csp")
            before = cell.joint
            trace = cell.compute(next(loop), 0.5)
            next(loop)
            assert arm.stopped == (StopReason.MODE_CHANGE,)
        assert HANDOVER <= trace.powered_ms <= HANDOVER + 4
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION
    sent = requested(sent_to_axis(recording, plan), CSP)
    assert {each.torque for each in sent[:HANDOVER]} == {LOAD_RAW}


@pytest.mark.parametrize("refused", [CSV, CST])
def test_a_refused_mode_is_reported_and_the_old_one_continues(refused: int) -> None:
    """Bound: the arm holds."""
    with vertical_cell(quirks=ServoQuirks(refused_modes=(refused,))) as cell:
        arm = cell.drives(mode="csp", other_modes=["csv", "cst"], velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300)
            arm.switch("csv" if refused == CSV else "cst")
            before = cell.joint
            follow(cell, arm, loop, MODE_TIMEOUT + 20)
            assert abs(cell.fall(before)) < RESOLUTION
            [event] = [e for e in cell.main.events if isinstance(e, events.ModeRefused)]
            assert (event.axis, event.mode) == (arm.names[0], refused)
            assert arm.enabled.all()
            follow(cell, arm, loop, 300, 0.5)  # and follows its set-points
            assert cell.joint - before == pytest.approx(0.15, abs=0.02)


def test_a_refused_mode_in_cst_is_a_quick_stop() -> None:
    with vertical_cell(quirks=ServoQuirks(refused_modes=(CSP,))) as cell:
        arm = cell.drives(mode="cst", other_modes=["csp"], velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            follow(cell, arm, loop, 100)
            arm.switch("csp")
            before = cell.joint
            trace = cell.compute(next(loop), 0.5)
            next(loop)
            assert arm.stopped == (StopReason.MODE_CHANGE,)
        assert trace.powered_ms <= HANDOVER + 4
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION


def test_csp_to_csv_enters_with_the_actual_velocity() -> None:
    """Bound of the deviation from a constant velocity: the application's cycle, and the lag."""
    with vertical_cell(quirks=ServoQuirks(mode_delay=0.005)) as cell:
        arm = cell.drives(mode="csp", other_modes=["csv"], velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300, 0.5)
            arm.switch("csv")
            slowest = 0.5
            for cycle in loop:
                arm.target.velocity[:] = 0.5
                slowest = min(slowest, cell.velocity)
                if arm.actual.mode[0] == CSV and cycle.number > 500:
                    break
            assert arm.enabled.all()
        assert slowest > 0.3
