"""Set-points of a background program: how long they are valid in each mode."""

import math

import pytest

from catenary.core import CYCLE_DROPPED, REQUEST_ENABLED, Stream
from catenary.plan.stop_reason import StopReason
from tests.core.rig import CSP, CST, CSV, MS, Bench, ScriptedDrive, axis, bench
from tests.core.test_fallback import OE, QUICK_STOP, Recorder, moving, working


def in_background(mode: int, **more: object) -> Bench:
    """One axis that follows the updates of a program in the background."""
    b = bench(axis(0, mode=mode, **more), drives=[ScriptedDrive()])
    b.engine.background = True
    b.ask(REQUEST_ENABLED)
    update(b)
    b.steps(12)
    assert b.axis_flags[0] & 1
    return b


def update(b: Bench) -> None:
    b.engine.begin_update()
    b.engine.end_update(True)


def test_csp_holds_without_limit_while_nothing_is_committed() -> None:
    b = in_background(CSP, deceleration=100.0)
    moving(b, 2.0)
    b.engine.spend(2000 * MS)
    assert b.drives[0].state == OE
    held = b.drives[0].target_position
    b.engine.spend(100 * MS)
    assert b.drives[0].target_position == held
    assert b.stop_reason[0] == StopReason.NONE


def test_csv_counts_for_200_ms_after_an_update_then_decelerates_and_holds() -> None:
    b = in_background(CSV, deceleration=100.0)
    b.target_velocity[0] = 1.0
    update(b)
    log = Recorder(b)
    b.engine.spend(1000 * MS)  # the program and its thread are stuck
    assert set(log.velocities[2:198]) == {1000}
    assert log.velocities[-1] == 0
    assert b.drives[0].state == OE
    assert b.stop_reason[0] == StopReason.NONE
    b.steps(1)
    assert b.target_velocity[0] == 0.0
    b.target_velocity[0] = 0.5
    update(b)
    b.steps(20)
    assert b.drives[0].target_velocity == 500


def test_an_update_does_not_revive_a_velocity_that_has_timed_out() -> None:
    b = in_background(CSV)
    b.target_velocity[0] = 1.0
    update(b)
    b.steps(300)
    update(b)
    b.steps(20)
    assert b.drives[0].target_velocity == 0


@pytest.mark.parametrize("mode", [CSV, CST])
def test_the_first_update_stays_while_it_enables_the_axis(mode: int) -> None:
    b = bench(axis(0, mode=mode), drives=[ScriptedDrive()])
    b.engine.background = True
    b.ask(REQUEST_ENABLED)
    b.steps(5)
    b.target_velocity[0] = b.target_torque[0] = 1.0
    update(b)
    b.steps(12)
    assert (b.target_velocity if mode == CSV else b.target_torque)[0] == 1.0
    assert (b.drives[0].target_velocity if mode == CSV else b.drives[0].target_torque) == 1000


def test_targets_stay_as_they_are_written_during_an_update() -> None:
    b = in_background(CSV)
    b.steps(300)
    b.engine.begin_update()
    b.target_velocity[0] = 1.0
    b.engine.keep_targets()
    b.engine.next()
    assert b.target_velocity[0] == 1.0
    b.engine.end_update(False)
    b.engine.next()
    assert b.target_velocity[0] == 0.0


def test_an_update_begun_before_an_axis_was_enabled_does_not_move_it() -> None:
    b = bench(axis(0, mode=CSP), drives=[ScriptedDrive()])
    b.engine.background = True
    b.ask(REQUEST_ENABLED)
    b.engine.next()
    b.engine.begin_update()
    b.target_position[0] = 0.05
    for _ in range(12):
        b.engine.keep_targets()
        b.engine.next()
    b.engine.end_update(True)
    b.steps(20)
    assert b.drives[0].target_position == 0
    assert b.target_position[0] == 0.0


@pytest.mark.parametrize("complete", [True, False])
def test_what_such_an_update_wrote_is_not_committed_later(complete: bool) -> None:
    b = bench(axis(0, mode=CSP), drives=[ScriptedDrive()])
    b.engine.background = True
    b.ask(REQUEST_ENABLED)
    b.engine.next()
    b.engine.begin_update()
    b.target_position[0] = 0.05
    for _ in range(12):
        b.engine.keep_targets()
        b.engine.next()
    b.engine.end_update(complete)
    sent = []
    for _ in range(20):  # as the iteration does, which may not wait for a cycle before
        b.engine.commit_targets()
        b.engine.next()
        sent.append(b.drives[0].target_position)
    assert set(sent) == {0}
    assert b.target_position[0] == 0.0


def test_repeating_an_update_does_not_renew_it() -> None:
    b = in_background(CSV, deceleration=100.0)
    b.target_velocity[0] = 1.0
    update(b)
    b.steps(150)
    assert b.drives[0].target_velocity == 1000
    b.steps(80)
    assert b.drives[0].target_velocity == 0


def test_cst_counts_for_20_ms_then_quick_stop() -> None:
    b = in_background(CST)
    b.target_torque[0] = 2.0
    update(b)
    log = Recorder(b)
    flags = 0
    for _ in range(30):
        flags |= b.engine.next()
    count = log.words.index(QUICK_STOP)
    assert 19 <= count <= 23
    assert set(log.torques[1:count]) == {2000}
    assert flags & CYCLE_DROPPED
    assert b.stop_reason[0] == StopReason.COMMAND_TIMEOUT


@pytest.mark.parametrize("mode", [CSV, CST])
def test_an_axis_is_not_enabled_before_the_first_update(mode: int) -> None:
    b = bench(axis(0, mode=mode), drives=[ScriptedDrive()])
    b.engine.background = True
    b.ask(REQUEST_ENABLED)
    b.steps(50)
    assert b.drives[0].state == 1
    update(b)
    b.steps(12)
    assert b.drives[0].state == OE


def test_a_refused_set_point_still_ends_after_the_late_limit() -> None:
    b = in_background(CSP)
    b.target_position[0] = math.nan
    b.steps(60)
    assert b.stop_reason[0] == StopReason.REFUSED


def test_an_empty_stream_is_an_underrun_as_ever() -> None:
    b = in_background(CSP)
    stream = Stream(1, 100)
    b.engine.set_stream(stream)
    stream.write(b"".join([bytes(24)] * 5), b.engine.number)
    b.steps(100)
    assert b.stop_reason[0] == StopReason.UNDERRUN


def test_an_update_before_a_stream_does_not_count_after_it() -> None:
    b = in_background(CSV, deceleration=100.0)
    b.target_velocity[0] = 1.0
    update(b)
    b.engine.set_stream(Stream(1, 100))
    b.engine.set_stream(None)
    b.target_velocity[0] = 1.0
    b.steps(30)
    assert b.drives[0].target_velocity == 0


def test_a_hand_over_in_cst_keeps_its_own_time() -> None:
    b = in_background(CST)
    log = Recorder(b)
    b.target_torque[0] = 2.0
    update(b)
    b.steps(2)
    b.engine.set_stream(Stream(1, 100))
    b.engine.run(1)
    b.engine.set_stream(None)
    b.steps(10)
    assert QUICK_STOP not in log.words
    b.steps(20)
    assert QUICK_STOP in log.words


def test_kept_targets_are_not_committed() -> None:
    b = working(CSP)
    before = b.drives[0].target_position
    b.target_position[0] += 0.05
    b.engine.keep_targets()
    b.engine.next()
    assert b.drives[0].target_position == before
    b.steps(200)
    assert b.drives[0].target_position == before + 50


def test_an_inline_cycle_has_no_background() -> None:
    b = bench(axis(0), drives=[ScriptedDrive()], execution="inline")
    with pytest.raises(ValueError, match="inline"):
        b.engine.background = True
