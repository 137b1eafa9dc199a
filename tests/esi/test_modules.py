"""Modules in slots: choice, increments, and errors (src/catenary/esi/placement.py and others)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.esi.configured import expand
from catenary.esi.device import EsiSlot
from catenary.esi.placement import default_placements, slot_places
from catenary.esi.reader import read_esi
from catenary.model.device import Direction
from tests.esi.esi_file import module as module_text
from tests.esi.esi_file import write
from tests.esi.modular import AI, DI, DO, MODULES, STATUS, coupler


def test_a_module_moves_by_the_increments_of_its_slot() -> None:
    first, second = expand(coupler(), ["8 DI", "8 DO"])
    assert (first.slot, first.input_pdos[0].index) == (0, 0x1A00)
    assert (second.slot, second.output_pdos[0].index) == (1, 0x1601)
    assert [e.index for e in second.output_pdos[0].entries] == [0x7010, 0x7010, 0]
    assert second.init_commands[0].index == 0x8010
    assert [(e.index, e.subindex, e.name) for e in second.documented] == [(0x8010, 1, "Filter")]
    assert second.slot_name == "Terminals 2"


@pytest.mark.parametrize("name", ["4 AI", "4 ai", " 4  AI ", "4 AI terminal", AI, "0x33", "#x33"])
def test_a_module_is_found_by_type_name_or_ident(name: str | int) -> None:
    (found,) = expand(coupler(), [name])
    assert found.ident == AI


@pytest.mark.parametrize("empty", [None, "", 0])
def test_empty_slots_keep_their_numbers(empty: str | int | None) -> None:
    found = expand(coupler(), ["8 DI", empty, "4 AI"])
    assert [each.slot for each in found] == [0, 2]
    assert found[1].input_pdos[0].index == 0x1A02


def test_without_depend_on_slot_the_index_stays() -> None:
    fixed = replace(MODULES[0].pdos[0], depends_on_slot=False)
    device = coupler(modules=(replace(MODULES[0], pdos=(fixed,)),))
    (found,) = expand(device, [DI])
    assert found.input_pdos[0].index == 0x1A00


def test_excluded_pdos_move_too() -> None:
    pdo = replace(MODULES[0].pdos[0], excludes=frozenset((0x1A40,)), excludes_depend_on_slot=True)
    device = coupler(modules=(*MODULES[1:], replace(MODULES[0], pdos=(pdo,))))
    found = expand(device, [DO, DI])
    assert found[1].input_pdos[0].excludes == {0x1A41}


def test_instances_and_slots_number_consecutively_and_own_increments_count() -> None:
    device = coupler(
        EsiSlot("Power", 0, 1, (DI,)),
        EsiSlot("Terminals", 0, 2, (DO,), pdo_increment=4, index_increment=0x100),
    )
    assert device.slots is not None
    places = [(p.number, p.name, p.pdo_offset) for p in slot_places(device.slots)]
    assert places == [(0, "Power", 0), (1, "Terminals 1", 4), (2, "Terminals 2", 8)]
    (found,) = expand(device, [None, None, DO])
    assert found.output_pdos[0].index == 0x1608
    assert found.output_pdos[0].entries[0].index == 0x7200


def test_the_number_of_slots_is_bounded() -> None:
    device = coupler(EsiSlot("Terminals", 0, 60000, (DI,)))
    assert device.slots is not None
    assert len(list(slot_places(device.slots))) == 255
    assert len(list(slot_places(replace(device.slots, max_slot_count=4)))) == 4


def test_a_slot_accepts_modules_of_its_class() -> None:
    device = coupler(EsiSlot("Analog", 0, 1, module_classes=("analog",)))
    assert expand(device, ["4 AI"])[0].ident == AI
    with pytest.raises(ConfigurationError, match=r"slot 0 \(Analog\) does not accept") as info:
        expand(device, ["8 DI"])
    assert "'4 AI' (0x00000033)" in info.value.hint
    assert "8 DO" not in info.value.hint


def test_an_unknown_module_lists_the_accepted_ones() -> None:
    with pytest.raises(ConfigurationError, match="unknown module '8 DIs' for slot 1") as info:
        expand(coupler(), ["8 DI", "8 DIs"])
    assert "did you mean '8 DI'?" in info.value.hint
    assert "coupler.xml:3" in str(info.value)


def test_an_ambiguous_name_needs_an_ident() -> None:
    device = coupler(modules=(MODULES[0], replace(MODULES[2], type="8 DI")))
    with pytest.raises(ConfigurationError, match="several modules with the name '8 DI'"):
        expand(device, ["8 DI"])


def test_a_required_slot_cannot_be_empty() -> None:
    with pytest.raises(ConfigurationError, match=r"slot 0 \(Terminals 1\) must have"):
        expand(coupler(), [None, "8 DI"])


def test_too_many_modules() -> None:
    with pytest.raises(ConfigurationError, match="has 4 elements, but the device has 3 slots"):
        expand(coupler(), [DI] * 4)


def test_two_modules_cannot_have_the_same_pdo() -> None:
    fixed = replace(MODULES[0].pdos[0], depends_on_slot=False)
    device = coupler(modules=(replace(MODULES[0], pdos=(fixed,)),))
    with pytest.raises(ConfigurationError, match="PDO 0x1A00 belongs to '8 DI' in slot 0"):
        expand(device, [DI, DI])


def test_a_module_overwrites_a_pdo_of_the_device_only_if_it_may() -> None:
    own = replace(STATUS, index=0x1A00)
    with pytest.raises(ConfigurationError, match="belongs to the device itself"):
        expand(coupler(pdos=(own,)), [DI])
    assert expand(coupler(pdos=(replace(own, overwritten_by_module=True),)), [DI])


def test_indices_stay_below_the_end_of_the_dictionary() -> None:
    device = coupler(EsiSlot("T", 0, 2, (DI,), index_increment=0xF000))
    with pytest.raises(ConfigurationError, match="indices above 0xFFFF"):
        expand(device, [None, DI])


def test_a_device_without_slots_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="has no slots for modules"):
        expand(coupler(slots=None), ["8 DI"])
    with pytest.raises(TypeError, match="is not a list"):
        expand(coupler(), "8 DI")


def test_default_modules_fill_the_required_instances() -> None:
    assert [each.place.number for each in default_placements(coupler())] == [0]


def test_the_axes_of_a_real_device(shared_data: Path) -> None:
    (device,) = read_esi(shared_data / "esi" / "hpm_ECAT_CIA402.xml").devices
    one, two = expand(device, ["csv,csp - axis", "csp - axis"])
    assert [pdo.index for pdo in (*one.output_pdos, *one.input_pdos)] == [0x1600, 0x1A00]
    assert [pdo.index for pdo in (*two.output_pdos, *two.input_pdos)] == [0x1611, 0x1A11]
    assert [e.index for e in two.output_pdos[0].entries][:2] == [0x6840, 0x687A]
    assert (one.axes, two.axes) == ((0,), (1,))
    assert {each.direction for each in device.modules[0].pdos} == set(Direction)


def test_slots_as_text_mark_the_default_module(shared_data: Path) -> None:
    [device] = read_esi(shared_data / "esi" / "hpm_ECAT_CIA402.xml").devices
    assert str(device.slots) == (
        "slot 0  Axis 0  required\n"
        "    0x00119800  csv,csp - axis\n"
        "    0x00219800  csp - axis\n"
        "    0x00319800  csv - axis  default\n"
        "slot 1  Axis 1\n"
        "    0x00119800  csv,csp - axis\n"
        "    0x00219800  csp - axis\n"
        "    0x00319800  csv - axis"
    )


def test_a_module_that_was_not_found_is_listed() -> None:
    slots = coupler(EsiSlot("Terminals", 2, 8, (0x99,), 0x99)).slots
    assert str(slots) == (
        "slots 0 to 7  Terminals  at least 2 occupied\n    0x00000099  (not found)  default"
    )


def test_the_group_of_a_module_is_read(tmp_path: Path) -> None:
    text = module_text(0x77).replace("ModuleIdent=", 'ModulePdoGroup="2" ModuleIdent=')
    path = write(tmp_path / "modules.xml", modules=text)
    [found] = read_esi(path).modules
    assert (found.ident, found.pdo_group) == (0x77, 2)
