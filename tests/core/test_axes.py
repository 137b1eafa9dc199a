"""Axis records: scales, counters that wrap, modes, and the outputs written."""

import pytest

from catenary.plan.cycle import NumberKind
from tests.core.rig import COUNTS, CST, ScriptedDrive, axis, bench, number


def test_a_position_counter_is_followed_round_both_ways() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=2**31 - 10, moves=False)])
    b.engine.run(1)
    start = b.actual_position[0]
    travelled = 0
    for step in (15, 1_000_000_000, 1_500_000_000, 2_000_000_000, -100, -2_000_000_000, 7):
        b.drives[0].position += step
        travelled += step
        b.engine.run(1)
        assert b.actual_position[0] - start == pytest.approx(travelled / COUNTS)


def test_a_target_beyond_the_counter_wraps() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(position=2**31 - 100)])
    b.enable()
    home = b.actual_position[0]
    b.target_position[0] = home + 1.0
    b.engine.next()
    assert b.drives[0].target_position == -(2**31) + 900
    assert b.actual_position[0] == pytest.approx(home + 1.0)


@pytest.mark.parametrize("bits", [12, 16, 24])
def test_shorter_counters(bits: int) -> None:
    short = number(7, bits, NumberKind.UNSIGNED, scale=0.5)
    b = bench(axis(0, actual_position=short, target_position=None))
    b.drives[0].position = 5
    b.engine.run(1)
    b.drives[0].position = -5  # below zero: the counter shows 2**bits - 5
    b.engine.run(1)
    assert b.actual_position[0] == -2.5


def test_scale_offset_and_sign() -> None:
    turned = number(7, 32, scale=-1 / COUNTS, offset=10.0)
    b = bench(axis(0, actual_position=turned, target_position=turned))
    b.drives[0].position = 3000
    b.enable()
    assert b.actual_position[0] == pytest.approx(7.0)
    assert b.drives[0].target_position == 3000
    b.target_position[0] = 6.0
    b.engine.next()
    assert b.drives[0].target_position == 4000


def test_torque_and_velocity_have_their_own_scales() -> None:
    b = bench(axis(0, mode=CST, actual_velocity=number(3, 32, scale=0.25)))
    b.drives[0].velocity = -8
    b.drives[0].torque = 1500
    b.engine.run(1)
    assert b.actual_velocity[0] == -2.0
    assert b.actual_torque[0] == pytest.approx(1.5)


def test_what_is_not_mapped_is_not_written() -> None:
    plan = axis(0, target_velocity=None, target_torque=None, mode_target=None)
    b = bench(plan, drives=[ScriptedDrive(mode_shown=8)])
    b.enable()
    b.target_position[0] = 0.5
    b.engine.next()
    drive = b.drives[0]
    assert (drive.mode, drive.target_velocity, drive.target_torque) == (0, 0, 0)
    assert drive.target_position == 500


def test_the_words_and_modes_are_shown() -> None:
    b = bench(axis(0), drives=[ScriptedDrive(state=7, mode_shown=7)])
    b.engine.run(1)
    assert b.statusword[0] == 0x0218
    assert b.mode_actual[0] == 7
    assert b.axis_state[0] == 7
    assert b.mode_target[0] == 8


def test_control_bits_of_the_mode_only_while_enabled_and_never_those_of_the_state_machine() -> None:
    b = bench(axis(0))
    b.controlword_bits[0] = 0xFFFF
    b.engine.run(1)
    assert b.drives[0].controlword == 0xF800
    b.enable()
    assert b.drives[0].controlword == 0x0F | 0xFB70
