"""Drives and terminals have mappings that must stay: other PDOs at power-up than in the SII,
fixed PDOs, PDOs that exclude each other, or one object in two PDOs.
The axes move, the terminals are read, and nothing is written without a request.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import MappingError
from catenary.types import UINT
from catenary.virtual import AnalogInputs, Coupler, MappingQuirks, Servo
from tests.scenario.cell import OP, Cell, cell_of

QUIRKS = {
    "none": MappingQuirks(),
    "fixed and declared": MappingQuirks(fixed_pdos="declared", fixed_lists="declared"),
    "fixed, not declared": MappingQuirks(fixed_pdos="silent", fixed_lists="silent"),
    "denied by the SII": MappingQuirks(coe_details=0x23),
    "no mode can be mapped": MappingQuirks(
        power_up=(0x1601, 0x1A01), refused_objects=(0x6060, 0x6061)
    ),
    "other PDOs than in the SII": MappingQuirks(
        power_up=(0x1601, 0x1A01), fixed_lists="silent", fixed_pdos="silent"
    ),
    "nothing at power-up": MappingQuirks(power_up=(), fixed_pdos="silent"),
    "exclusive": MappingQuirks(power_up=(0x1601, 0x1A01), exclusive=True, fixed_pdos="declared"),
}


@pytest.mark.parametrize("name", QUIRKS)
def test_a_drive_moves_with_any_mapping(name: str) -> None:
    with cell_of(Coupler(), Servo(mapping_quirks=QUIRKS[name])) as cell:
        arm = cell.drives()
        move(cell, arm)


def move(cell: Cell, arm: cat.Drives) -> None:
    """Move by 0.5 rad in 0.5 s, and check that no mapping was written."""
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + cycle.time
            if cycle.time > 0.5:
                break
        assert cell.states[1] == OP
        assert cell.servos[0].position_rad == pytest.approx(home[0] + 0.5, abs=0.05)
    cell.assert_safe()


def test_pdos_are_replaced_for_a_mode_that_the_assigned_ones_lack() -> None:
    quirks = MappingQuirks(power_up=(0x1601, 0x1A01), exclusive=True, fixed_pdos="declared")
    with cell_of(Coupler(), Servo(mapping_quirks=quirks)) as cell:
        arm = cell.drives(mode="csv")
        with cat.Loop(arm) as loop:
            arm.enable()
            for cycle in loop:
                arm.target.velocity[:] = 1.0
                if cycle.time > 1.0:
                    break
            assert cell.servos[0].velocity_rad_s == pytest.approx(1.0, rel=0.1)
            assert "0x6060:00" not in loop.plan.devices[1].left_out  # optional, but mapped, too
        assert cell.subs[1].sdo.read(0x1C12, 1, type=UINT) == 0x1600


def test_a_column_missing_in_fixed_pdos_is_refused_before_any_write() -> None:
    quirks = MappingQuirks(fixed_pdos="declared")
    with cell_of(Coupler(), Servo(mapping_quirks=quirks)) as cell:
        arm = cell.drives(columns=["position_demand"])
        with pytest.raises(MappingError, match="all its PDOs are fixed"), cat.Loop(arm):
            pytest.fail("entered without the column")


def test_the_application_selects_the_pdos() -> None:
    with cell_of(Coupler(), Servo(mapping_quirks=MappingQuirks(coe_details=0x23))) as cell:
        pdos = {0x1601: [], 0x1A00: [(0x6041, 0, 16), (0x6064, 0, 32), (0x6062, 0, 32)]}
        arm = cell.drives(pdos=pdos, columns=["position_demand"])
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 50:
                    break
            assert arm.actual["position_demand"] == pytest.approx(arm.actual.position, abs=1e-3)
        assert cell.subs[1].sdo.read(0x1C12, 1, type=UINT) == 0x1601


def test_a_terminal_is_switched_to_its_compact_pdos() -> None:
    gauges = AnalogInputs(second_pdo="compact")
    with cell_of(Coupler(), gauges) as cell:
        gauges.apply_volts(1, 5.0)
        values = cat.Inputs(cell.subs[1], pdos=[0x1A10, 0x1A11])
        assert len(values.names) == 2
        with cat.Loop(values) as loop:
            for cycle in loop:
                if cycle.number == 20:
                    break
            assert values[values.names[1]] == pytest.approx(0x4000, abs=1)


def test_one_object_in_two_pdos_is_two_columns() -> None:
    """EL3632: 0x6000:02 is mapped twice with different sizes."""
    gauges = AnalogInputs(channels=1, second_pdo="twice")
    with cell_of(Coupler(), gauges) as cell:
        gauges.apply_volts(0, 0.01)  # 33 counts fit 8 bits
        both = cat.Inputs(cell.subs[1])
        whole, short = [name for name in both.names if "Value" in name]
        with cat.Loop(both) as loop:
            for cycle in loop:
                if cycle.number == 20:
                    break
            assert both[whole] == both[short] == 33
        places = [column.number for column in loop.plan.cycle.input_columns[:5]]
        assert len({place.bit_offset for place in places}) == len(places)
