"""A cell of terminals and drives of many kinds: all process data have names, even single bits.
Inputs are read and outputs are written by name. The virtual terminals confirm the values.
"""

import pytest

import catenary as cat
from catenary.virtual import AnalogInputs, Coupler, DigitalInputs, DigitalOutputs, Servo
from tests.scenario.cell import Cell, cell_of


def bits(number: int, count: int) -> list[int]:
    return [number >> k & 1 for k in range(count)]


def test_digital_and_analogue_values_by_name_and_by_bit() -> None:
    buttons, lamps, gauges = DigitalInputs(bits=8), DigitalOutputs(bits=12), AnalogInputs()
    with cell_of(Coupler(), buttons, lamps, gauges) as cell:
        pressed, shining = cat.Inputs(cell.subs[1]), cat.Outputs(cell.subs[2])
        gauge = cat.Inputs(cell.subs[3])
        buttons.inputs = 0b1010_0101
        with cat.Loop(pressed, shining, gauge, period=2e-3) as loop:
            for cycle in loop:
                shining.bits[:8] = pressed.bits
                shining[shining.names[11]] = 1
                if cycle.number == 20:
                    assert pressed.bits.tolist() == bits(0b1010_0101, 8)
                    assert pressed[pressed.names[2]] == 1
                    assert lamps.outputs == 0b1000_1010_0101
                    buttons.inputs = 0
                if cycle.number == 40:
                    assert lamps.outputs == 0b1000_0000_0000
                    break
        assert lamps.outputs == 0  # out of OP


def test_an_analogue_value_has_the_unit_it_is_given() -> None:
    gauges = AnalogInputs()
    with cell_of(Coupler(), gauges) as cell:
        names = cat.Inputs(cell.subs[1]).names
        value = next(name for name in names if "Value" in name)
        volts = cat.Inputs(cell.subs[1], scale={value: 10.0 / 0x7FFF})
        gauges.apply_volts(0, 2.5)
        with cat.Loop(volts) as loop:
            for cycle in loop:
                if cycle.number == 50:
                    break
            assert volts[value] == pytest.approx(2.5, abs=1e-3)


def test_process_data_of_drives_have_names(cell: Cell) -> None:
    words = cat.Inputs(cell.subs[2])
    arm = cell.drives()
    with cat.Loop(arm, words) as loop:
        for cycle in loop:
            if cycle.number == 10:
                break
        assert words["Modes of operation display"] == 8
        assert words["Statusword"] & 0x6F == 0x27


def test_additional_columns_of_the_axes(cell: Cell) -> None:
    arm = cell.drives(columns=["following_error", "torque_offset", "error_code"])
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 3.0 * cycle.time
            arm.target["torque_offset"][0] = 0.2
            if cycle.number == 400:
                break
        lag = arm.target.position - arm.actual.position
        assert arm.actual["following_error"] == pytest.approx(lag, abs=0.02)
        assert arm.actual["error_code"].tolist() == [0, 0]


def test_different_drives_form_one_arm() -> None:
    servos = (
        Servo(axes=2, counts_per_turn=2**20),
        Servo(counts_per_turn=2**17, velocity_counts_per_turn=1000, rated_torque=0.5),
    )
    with cell_of(Coupler(), servos[0], DigitalOutputs(), servos[1]) as cell:
        gears, directions, offsets = [10.0, 1.0, 5.0], [1, -1, -1], [0.0, 0.25, -1.0]
        arm = cat.Drives(
            cell.subs.drives,
            counts_per_turn=[2**20, 2**20, 2**17],
            velocity_limit=100.0,
            gear_ratio=gears,
            direction=directions,
            offset=offsets,
            velocity_unit=[None, None, 2 * 3.141592653589793 / 1000],
        )
        assert len(arm) == 3
        with cat.Loop(arm) as loop:
            home = arm.actual.position.copy()
            assert home == pytest.approx(offsets)
            for cycle in loop:
                arm.target.position[:] = home + 0.8 * cycle.time
                if cycle.time > 1.0:
                    break
            assert arm.actual.velocity == pytest.approx([0.8] * 3, rel=0.1)
            motors = [
                servos[0].axis_position(0),
                servos[0].axis_position(1),
                servos[1].position_rad,
            ]
            for k, motor in enumerate(motors):
                joint = directions[k] * motor / gears[k] + offsets[k]
                assert joint == pytest.approx(arm.actual.position[k], abs=1e-3)
                assert joint == pytest.approx(home[k] + 0.8, abs=0.02)
        cell.assert_safe()
