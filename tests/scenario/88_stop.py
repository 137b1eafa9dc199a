"""An axis in CST carries its load and is stopped: by a call, by leaving the loop, by the core.
The last torque stays in every frame until the drive has left OPERATION ENABLED. A drive that
ignores the quick stop is sent disable operation, then disable voltage.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import LawError
from catenary.plan.cycle import CyclePlan
from catenary.virtual import ServoQuirks
from tests.scenario.frames import SentOutputs, sent_to_axis
from tests.scenario.vertical import LOAD, MS, RAMP, RESOLUTION, follow, vertical_cell

ENABLE, QUICK_STOP, DISABLE_OPERATION, DISABLE_VOLTAGE = 0x0F, 0x02, 0x07, 0x00
RUN, DRIVE_OFF, SYNCHRONISATION = 0xE000, 0x4000, 0x0400  # S-0-0134
LOAD_RAW = 500  # per mille of the rated torque
SLOW_DOWN = RAMP / 2  # rad/s²: the servo's 0x6084, which 0x605C uses
EFFECT = 2 * MS  # from a controlword in the outputs to its effect


class Stumble(Exception):
    pass


def disable(arm: cat.Drives, loop: cat.Loop) -> None:
    arm.disable()


def quick_stop(arm: cat.Drives, loop: cat.Loop) -> None:
    arm.quick_stop()


def leave(arm: cat.Drives, loop: cat.Loop) -> None:
    raise Stumble


def be_late(arm: cat.Drives, loop: cat.Loop) -> None:
    next(loop).spend(0.1)


def write_nan(arm: cat.Drives, loop: cat.Loop) -> None:
    for _ in range(60):
        arm.target.torque[:] = arm.target.position[:] = float("nan")
        next(loop)


@pytest.mark.parametrize("mode", ["cst", "csp"])
@pytest.mark.parametrize("stop", [disable, quick_stop, leave, be_late, write_nan])
def test_never_zero_torque_in_the_frame_that_stops(
    stop: Callable[[cat.Drives, cat.Loop], None], mode: str, tmp_path: Path
) -> None:
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(mode=mode, velocity_limit=6.0)
        try:
            with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
                plan = loop.plan.cycle
                follow(cell, arm, loop, 100)
                before = cell.joint
                stop(arm, loop)
                follow(cell, arm, loop, 300)
        except Stumble:
            pass
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION
        assert not cell.powered
        cell.let_pass(1.0)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION
    sent = sent_to_axis(recording, plan)
    first = [k for k, each in enumerate(sent) if each.controlword == ENABLE][-1] + 1
    assert sent[first].controlword == (DISABLE_OPERATION if stop is disable else QUICK_STOP)
    if mode == "cst":  # and in the next one: the drive's answer is not there yet
        assert [each.torque for each in sent[first - 1 : first + 2]] == [LOAD_RAW] * 3


@pytest.mark.parametrize("mode", ["cst", "csp"])
@pytest.mark.parametrize("stop", [disable, quick_stop, leave, be_late, write_nan])
def test_a_sercos_drive_brakes_before_it_removes_its_torque(
    stop: Callable[[cat.Drives, cat.Loop], None], mode: str, tmp_path: Path
) -> None:
    """Drive off (bit 14 alone) until the drive has no torque; then 0."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording, sercos=True) as cell:
        arm = cell.drives(mode=mode, velocity_limit=6.0)
        try:
            with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
                plan = loop.plan.cycle
                follow(cell, arm, loop, 100)
                before = cell.joint
                stop(arm, loop)
                follow(cell, arm, loop, 300)
        except Stumble:
            pass
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION
        assert not cell.powered
        cell.let_pass(1.0)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION
    sent = sent_to_axis(recording, plan)
    words = [each.controlword & ~SYNCHRONISATION for each in sent]
    first = [k for k, word in enumerate(words) if word == RUN][-1] + 1
    assert words[first : first + 2] == [DRIVE_OFF] * 2
    assert set(words[first:]) <= {DRIVE_OFF, 0}
    if mode == "cst":
        assert [each.torque for each in sent[first - 1 : first + 2]] == [LOAD_RAW] * 3


def runs(sent: list[SentOutputs]) -> list[tuple[int, int]]:
    """Return (controlword, number of frames in a row) from the last enable operation on."""
    first = [k for k, each in enumerate(sent) if each.controlword == ENABLE][-1] + 1
    found: list[tuple[int, int]] = []
    for each in sent[first:]:
        if found and found[-1][0] == each.controlword:
            found[-1] = (each.controlword, found[-1][1] + 1)
        else:
            found.append((each.controlword, 1))
    return found


IGNORES_QUICK_STOP = ServoQuirks(ignores_quick_stop=True)
IGNORES_BOTH = ServoQuirks(ignores_quick_stop=True, ignores_disable=True)


@pytest.mark.parametrize(("mode", "patience"), [("cst", 20), ("csp", 50), ("csv", 50)])
def test_a_drive_that_ignores_the_quick_stop_is_disabled(
    mode: str, patience: int, tmp_path: Path
) -> None:
    """Bound: the load is carried meanwhile; the fall until the brake has closed."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(quirks=IGNORES_QUICK_STOP, record=recording) as cell:
        arm = cell.drives(mode=mode, velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            plan: CyclePlan = loop.plan.cycle
            follow(cell, arm, loop, 100)
            before = cell.joint
            arm.quick_stop()
            cycle = next(loop)
            trace = cell.compute(cycle, 0.5)
        assert patience <= trace.powered_ms <= patience + 3
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION
    [(first, count), (second, _), *_] = runs(sent_to_axis(recording, plan))
    assert (first, second) == (QUICK_STOP, DISABLE_OPERATION)
    assert count == pytest.approx(patience, abs=1)


@pytest.mark.parametrize("torque", [LOAD, 15.0, 35.0])
def test_a_drive_that_ignores_both_loses_its_voltage(torque: float, tmp_path: Path) -> None:
    """Bound: the way with the kept torque for 40 ms, then a fall that begins at the velocity
    reached."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(quirks=IGNORES_BOTH, record=recording) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            plan: CyclePlan = loop.plan.cycle
            follow(cell, arm, loop, 100)
            arm.target.torque[:] = torque
            next(loop)
            arm.quick_stop()
            before, downwards = cell.joint, -cell.velocity
            cycle = next(loop)
            trace = cell.compute(cycle, 0.5)
        seconds = 0.020 + 0.020 + 2 * EFFECT
        assert 40 <= trace.powered_ms <= seconds / MS
        assert trace.torque[:39] == pytest.approx(torque, abs=0.1)
        kept = cell.kept_torque(torque, seconds, downwards)
        bound = kept.way + cell.fall_bound(velocity=kept.velocity)
        assert trace.fall(before) < bound + RESOLUTION
    sent = sent_to_axis(recording, plan)
    words = runs(sent)[:3]
    assert [word for word, _ in words] == [QUICK_STOP, DISABLE_OPERATION, DISABLE_VOLTAGE]
    assert [count for _, count in words[:2]] == pytest.approx([20, 20], abs=1)
    cut = next(k for k, each in enumerate(sent) if k > 100 and each.controlword == DISABLE_VOLTAGE)
    assert {each.torque for each in sent[cut - 40 : cut]} == {round(torque / LOAD * LOAD_RAW)}
    assert sent[cut].torque == 0


def test_disable_operation_slows_a_moving_axis_down() -> None:
    """Bound: v² / 2a of 0x6084 and the drive's lag, the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="csv", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300, -0.5)
            before, downwards = cell.joint, -cell.velocity
            arm.disable()
            cycle = next(loop)
            trace = cell.compute(cycle, 0.5)
        kept = cell.kept_torque(LOAD, EFFECT, downwards)
        assert trace.fall(before) < kept.ramp_bound(SLOW_DOWN) + cell.fall_bound() + RESOLUTION


def writes_nan(actual, target, parameters, time):
    for i in range(actual.n):
        target.torque[i] = parameters[0] if time < 0.05 else float("nan")


def test_a_law_that_fails_keeps_the_torque_in_the_frame_that_stops(tmp_path: Path) -> None:
    """Bound: the fall until the brake has closed."""
    pytest.importorskip("numba", reason="laws are compiled by Numba: catenary[law]")
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            follow(cell, arm, loop, 100)
            before = cell.joint
            with pytest.raises(LawError, match="NaN"):
                loop.run(writes_nan, parameters=[cell.gravity])
            follow(cell, arm, loop, 300)
            assert not cell.powered
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION
    sent = sent_to_axis(recording, plan)
    stop = next(k for k, each in enumerate(sent) if each.controlword == QUICK_STOP)
    assert [each.torque for each in sent[stop - 1 : stop + 2]] == [LOAD_RAW] * 3
