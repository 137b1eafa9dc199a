"""SERCOS axes: the words S-0-0134 and S-0-0135 at the edge of the CiA 402 state machine."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from catenary.core import state_of
from catenary.core._sercos import CONTROL, STATUS, control_word_of, statusword_of
from catenary.plan.cycle import AxisPlan, SyncUnit
from catenary.plan.stop_reason import StopReason
from tests.core.rig import Bench, ScriptedDrive, axis, bench
from tests.core.sercos_drive import (
    ENABLE,
    FAULT,
    NOT_READY,
    OPERATING,
    POWERED,
    READY,
    RUN,
    SYNCHRONISATION,
    ScriptedSercosDrive,
    sercos_axis,
)

DISABLED, ENABLED, QUICK_STOP, RESET = range(4)
CSP, CSV, CST = 8, 9, 10
OFF = ENABLE  # drive off
STATES = {  # bits 15 to 13 → CiA 402 state
    0b000: 0,
    0b010: 1,
    0b100: 3,
    0b110: 4,
    0b001: 7,
    0b011: 7,
    0b101: 7,
    0b111: 6,
}


# ---- tables


@pytest.mark.parametrize("bits", range(8))
@pytest.mark.parametrize("bit_3", [0, 1])
def test_every_pair_of_the_status_bits(bits: int, bit_3: int) -> None:
    """The other bits have no effect. Bit 12 is bit 3, in operation only."""
    for others in (0, 0x1FF7):
        word = statusword_of(bits << 13 | bit_3 << 3 | others)
        assert state_of(word) == STATES[bits]
        assert bool(word & 0x1000) == (bits == 0b110 and bit_3 == 1)


def test_every_status_word_has_one_row_and_no_unknown_state() -> None:
    for word in range(0x10000):
        first = next(status for mask, value, status in STATUS if word & mask == value)
        assert statusword_of(word) == first


def test_every_controlword() -> None:
    known = dict(CONTROL)
    for command in range(0x10000):
        assert control_word_of(command) == known.get(command & 0x0F, 0)
        assert control_word_of(command, True) == ENABLE
    assert known == {0x0F: RUN, 0x02: OFF, 0x07: OFF}


# ---- axes with a scripted drive


def one(drive: ScriptedSercosDrive | None = None, **more: object) -> Bench:
    return bench(sercos_axis(**more), drives=[drive or ScriptedSercosDrive()])


def drive_of(rig: Bench) -> ScriptedSercosDrive:
    drive = rig.drives[0]
    assert isinstance(drive, ScriptedSercosDrive)
    return drive


def sent(rig: Bench) -> list[int]:
    """Return S-0-0134 of all frames, without the synchronisation bit."""
    return [word & ~SYNCHRONISATION for word in drive_of(rig).sent]


def run(rig: Bench, cycles: int) -> None:
    """Iterate, and check that the torque is off in each cycle of 0x0000."""
    for _ in range(cycles):
        rig.target_position[:] = rig.target_position
        rig.engine.next()
        if sent(rig)[-1] == 0:
            assert not drive_of(rig).torque_on


def test_it_is_enabled_and_follows() -> None:
    rig = one()
    rig.enable()
    assert sent(rig)[0] == 0
    assert rig.axis_state[0] == 4
    assert sent(rig)[-1] == RUN
    rig.target_position[:] = 0.5
    rig.steps(3)
    assert drive_of(rig).position == 500
    assert rig.actual_position[0] == pytest.approx(0.5)
    assert rig.statusword[0] == 0x1027


def test_the_synchronisation_bit_toggles_in_each_frame() -> None:
    rig = one()
    rig.enable()
    rig.steps(6)
    bits = [word & SYNCHRONISATION for word in drive_of(rig).sent]
    assert all(a != b for a, b in pairwise(bits))


@pytest.mark.parametrize("request_", [DISABLED, QUICK_STOP])
def test_a_stop_is_drive_off_until_the_drive_removes_the_torque(request_: int) -> None:
    """The ramp lasts longer than the patience with a drive that shows no effect."""
    rig = one(ScriptedSercosDrive(ramp=300))
    rig.enable()
    rig.ask(request_)
    run(rig, 298)
    assert sent(rig)[-298:].count(OFF) >= 296
    assert 0 not in sent(rig)[-290:]
    assert drive_of(rig).torque_on
    run(rig, 10)
    assert not drive_of(rig).torque_on
    assert sent(rig)[-1] == 0
    run(rig, 50)
    assert set(sent(rig)[-50:]) == {0}


@pytest.mark.parametrize(("mode", "cycles"), [(CSP, 320), (CSV, 320), (CST, 40)])
def test_a_drive_that_ignores_drive_off_loses_its_torque_by_bit_14(mode: int, cycles: int) -> None:
    """In CSP and CSV, the core decelerates it until the stop deadline; in CST, it has 40 ms."""
    rig = bench(
        sercos_axis(mode=mode),
        drives=[ScriptedSercosDrive(ignores_drive_off=True)],
        stop_deadline_ns=300_000_000,
    )
    rig.ask(ENABLED)
    for _ in range(20):
        rig.target_velocity[:] = 1.5
        rig.target_torque[:] = 0.3
        rig.engine.next()
    assert rig.statusword[0] == 0x1027
    rig.ask(QUICK_STOP)
    before = len(sent(rig))
    run(rig, 400)
    words = sent(rig)[before:]
    assert words.count(OFF) == pytest.approx(cycles, abs=3)
    assert words[-1] == 0
    assert not drive_of(rig).torque_on
    assert drive_of(rig).target_velocity == 0


@pytest.mark.parametrize("mode", [CSP, CST])
def test_a_stop_before_it_follows_keeps_the_torque_while_the_brake_closes(mode: int) -> None:
    """After drive on, bit 3 is clear for S-0-0206. After drive off, its brake has S-0-0207."""
    rig = one(ScriptedSercosDrive(ramp=150, shows_bit_3=False), mode=mode)
    rig.target_torque[:] = 0.3
    rig.ask(ENABLED)
    for _ in range(20):
        rig.target_torque[:] = 0.3
        rig.engine.next()
    assert rig.statusword[0] == 0x0027
    rig.ask(DISABLED)
    run(rig, 149)
    assert drive_of(rig).torque_on
    assert sent(rig)[-1] == OFF
    run(rig, 5)
    assert drive_of(rig).state == POWERED


def test_it_ends_a_stop_before_it_is_enabled_again() -> None:
    """The ramp of the drive is not that of the command, so it must not follow within it."""
    rig = one(ScriptedSercosDrive(ramp=50))
    rig.enable()
    rig.target_position[:] = 0.5
    rig.steps(3)
    rig.ask(QUICK_STOP)
    run(rig, 10)
    drive_of(rig).position = 900  # where its ramp leads
    rig.ask(ENABLED)
    before = len(sent(rig))
    run(rig, 60)
    words = sent(rig)[before:]
    assert words[:36] == [OFF] * 36
    assert words[-1] == RUN
    assert drive_of(rig).state == OPERATING
    assert drive_of(rig).target_position == 900


def test_requests_within_a_ramp_do_not_end_it() -> None:
    rig = one(ScriptedSercosDrive(ramp=50))
    rig.enable()
    before = len(sent(rig))
    for request in (QUICK_STOP, ENABLED, DISABLED, ENABLED, QUICK_STOP):
        rig.ask(request)
        run(rig, 5)
    assert set(sent(rig)[before + 1 :]) == {OFF}
    run(rig, 50)
    assert drive_of(rig).state == POWERED
    assert sent(rig)[-1] == 0


def test_a_ramp_without_end_is_ended_by_the_stop_deadline() -> None:
    rig = bench(
        sercos_axis(),
        drives=[ScriptedSercosDrive(ramp=100_000)],
        stop_deadline_ns=300_000_000,
    )
    rig.enable()
    rig.ask(QUICK_STOP)
    run(rig, 299)
    assert drive_of(rig).torque_on
    run(rig, 40)
    assert not drive_of(rig).torque_on


def test_a_fault_in_motion_keeps_bit_14_until_the_reaction_ends() -> None:
    rig = one(ScriptedSercosDrive(reaction=100))
    rig.enable()
    drive_of(rig).fail()
    before = len(sent(rig))
    run(rig, 98)
    assert rig.axis_state[0] == 6
    assert set(sent(rig)[before + 1 :]) == {OFF}
    assert rig.stop_reason[0] == StopReason.FAULT
    run(rig, 5)
    assert drive_of(rig).state == FAULT
    assert rig.axis_state[0] == 7
    assert sent(rig)[-1] == 0


def test_a_reaction_without_end_is_ended_by_the_stop_deadline() -> None:
    rig = bench(
        sercos_axis(),
        drives=[ScriptedSercosDrive(reaction=100_000)],
        stop_deadline_ns=300_000_000,
    )
    rig.enable()
    drive_of(rig).fail()
    run(rig, 290)
    assert drive_of(rig).torque_on
    run(rig, 20)
    assert not drive_of(rig).torque_on


def test_a_reset_needs_the_mailbox_and_enables_nothing() -> None:
    rig = one(ScriptedSercosDrive(state=FAULT))
    rig.ask(RESET)
    run(rig, 20)
    assert set(sent(rig)) == {0}
    assert rig.axis_state[0] == 7
    drive_of(rig).state = POWERED  # S-0-0099
    run(rig, 20)
    assert set(sent(rig)) == {0}
    rig.ask(ENABLED)
    run(rig, 5)
    assert drive_of(rig).state == OPERATING


def test_a_request_to_enable_in_fault_takes_effect_after_the_reset() -> None:
    rig = one(ScriptedSercosDrive(state=FAULT))
    run(rig, 3)  # the core knows the fault
    rig.ask(ENABLED)
    run(rig, 20)
    assert set(sent(rig)) == {0}
    drive_of(rig).state = POWERED
    run(rig, 5)
    assert drive_of(rig).state == OPERATING


@pytest.mark.parametrize("state", [READY, NOT_READY])
def test_mains_lost_in_motion_needs_a_new_request(state: int) -> None:
    rig = one()
    rig.enable()
    drive_of(rig).state = state
    run(rig, 20)
    assert rig.stop_reason[0] == StopReason.LEFT_OPERATION
    drive_of(rig).state = POWERED  # the power returns
    run(rig, 100)
    assert drive_of(rig).state == POWERED
    assert set(sent(rig)[-100:]) == {0}
    rig.ask(ENABLED)
    run(rig, 5)
    assert drive_of(rig).state == OPERATING


@pytest.mark.parametrize("state", [READY, NOT_READY])
def test_a_drive_without_mains_power_gets_no_torque(state: int) -> None:
    rig = one(ScriptedSercosDrive(state=state))
    rig.ask(ENABLED)
    run(rig, 50)
    assert set(sent(rig)) == {0}
    drive_of(rig).state = POWERED
    run(rig, 5)
    assert drive_of(rig).state == OPERATING


def test_lost_frames_stop_it_and_its_first_frame_keeps_the_torque() -> None:
    """A drive that returns, still powered, is braked: its first frame is drive off."""
    rig = one(ScriptedSercosDrive(ramp=3))
    rig.enable()
    rig.segment.silent.add(0)
    rig.steps(10)
    assert rig.stop_reason[0] == StopReason.DEVICE_LOST
    count = len(sent(rig))
    rig.segment.silent.clear()
    rig.engine.next()
    assert sent(rig)[count:] == [OFF]
    run(rig, 20)
    assert not drive_of(rig).torque_on


def test_a_drive_that_returns_while_it_brakes_has_the_time_of_its_ramp() -> None:
    """It has cleared bit 3 already when its answers return."""
    rig = one(ScriptedSercosDrive(ramp=300))
    rig.enable()
    drive_of(rig).step(OFF)  # it brakes by itself, without frames
    rig.segment.silent.add(0)
    rig.steps(10)
    rig.segment.silent.clear()
    run(rig, 290)
    assert drive_of(rig).torque_on
    run(rig, 20)
    assert not drive_of(rig).torque_on


def test_bit_3_lost_for_long_stops_it() -> None:
    rig = one()
    rig.enable()
    drive_of(rig).shows_bit_3 = False
    rig.target_position[:] = 0.1
    rig.steps(40)
    assert rig.stop_reason[0] == StopReason.NOT_FOLLOWING
    assert drive_of(rig).state == POWERED


def test_a_torque_is_kept_in_the_frame_that_stops() -> None:
    rig = one(mode=CST)
    rig.target_torque[:] = 0.3
    rig.ask(ENABLED)
    for _ in range(20):
        rig.target_torque[:] = 0.3
        rig.engine.next()
    assert drive_of(rig).target_torque == 300
    rig.ask(QUICK_STOP)
    rig.target_torque[:] = 0.3
    rig.engine.next()
    assert (sent(rig)[-1], drive_of(rig).target_torque) == (OFF, 300)


def test_velocity_is_followed() -> None:
    rig = one(mode=CSV)
    rig.ask(ENABLED)
    for _ in range(20):
        rig.target_velocity[:] = 1.5
        rig.engine.next()
    assert drive_of(rig).target_velocity == 1500


@pytest.mark.parametrize("mode", [CSV, CST, 1])
@pytest.mark.parametrize("is_enabled", [False, True])
def test_another_mode_is_refused(mode: int, is_enabled: bool) -> None:
    rig = one()
    if is_enabled:
        rig.enable()
    rig.mode_target[:] = mode
    rig.steps(5)
    assert rig.axis_flags[0] & 32  # MODE_REFUSED
    assert rig.mode_actual[0] == CSP


def test_a_cia_402_axis_beside_it_is_unchanged() -> None:
    """The same frames reach the CiA 402 drive, alone or next to a SERCOS drive."""
    words = []
    for others in ([], [sercos_axis(1)]):
        cia = ScriptedDrive()
        mixed = bench(axis(0), *others, drives=[cia, *(ScriptedSercosDrive() for _ in others)])
        seen = []
        mixed.ask(ENABLED)
        for k in range(60):
            if k == 30:
                mixed.ask(QUICK_STOP)
            mixed.engine.next()
            seen.append((cia.controlword, cia.mode, cia.target_position, cia.state))
        words.append(seen)
    assert words[0] == words[1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mode": 1}, "mode 1"),
        ({"mode": 3}, "mode 3"),
        ({"mode_target": axis(0).mode_target}, "0x6060"),
        ({"mode_actual": axis(0).mode_actual}, "0x6061"),
        ({"on_loss": "csp_hold"}, "csp_hold"),
        ({"profile": "other"}, "profile 'other'"),
    ],
)
def test_impossible_plans_are_refused(change: dict[str, object], message: str) -> None:
    plan: AxisPlan = sercos_axis()
    with pytest.raises(ValueError, match=message):
        bench(replace(plan, **change))


def test_a_sync_unit_without_a_divider_is_refused() -> None:
    with pytest.raises(ValueError, match="divider 0 of its sync unit"):
        bench(sercos_axis(), sync_units=(SyncUnit("unit 0", (0,), divider=0),))
