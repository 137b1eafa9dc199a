"""Inputs and Outputs: process data as arrays and by name."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from catenary.drive import Inputs, Outputs
from catenary.drive.device_channels import unique_names
from catenary.model.device import Assignment, Direction, Entry, Pdo
from catenary.plan.cycle import Bank, NumberKind
from tests.drive.fakes import FakeLayout, views_of
from tests.plan.devices import servo


def sub_of(position: int, direction: Direction, *pdos: Pdo) -> SimpleNamespace:
    """Return a SubDevice with this process data in one direction."""
    assignments = (Assignment(sync_manager=0, pdos=pdos),)
    description = SimpleNamespace(
        position=position,
        modular=None,
        assignments=lambda wanted: assignments if wanted is direction else (),
        pdos=lambda wanted: pdos if wanted is direction else (),
    )
    return SimpleNamespace(position=position, description=description)


def terminal(position: int, direction: Direction, n: int, word: str) -> SimpleNamespace:
    """Return channels in separate PDOs whose entries have the same name, as in many terminals."""
    pdos = [
        Pdo(0x1600 + i, (Entry(0x7000 + 0x10 * i, 1, 1, word, 1),), 0, name=f"Channel {i + 1}")
        for i in range(n)
    ]
    return sub_of(position, direction, *pdos)


def opened(io: Inputs | Outputs) -> tuple:
    tables = io.tables(FakeLayout.of(dict(io.pdos(1_000_000))))
    views = views_of(tables)
    io.bind(views)
    return tables, views


def test_an_output_is_written_by_name_and_by_bit() -> None:
    lamps = Outputs(terminal(1, Direction.OUTPUT, 4, "Output"))
    assert lamps.names == (
        "Channel 1 Output",
        "Channel 2 Output",
        "Channel 3 Output",
        "Channel 4 Output",
    )
    tables, views = opened(lamps)
    assert [c.number.bit_offset for c in tables.output_columns] == [0, 1, 2, 3]
    lamps["Channel 3 Output"] = 1
    lamps.bits[0] = True
    assert views.output_bits.tolist() == [1, 0, 1, 0]
    assert lamps["Channel 1 Output"] == 1


def test_inputs_request_only_mapped_objects() -> None:
    buttons = Inputs(terminal(2, Direction.INPUT, 2, "Input"))
    request = buttons.pdos(1_000_000)[2]
    assert request.outputs == ()
    assert [(r.index, r.subindex, r.bit_length) for r in request.inputs] == [
        (0x7000, 1, 1),
        (0x7010, 1, 1),
    ]


def test_analogue_values_are_raw_integers_or_scaled() -> None:
    pdo = Pdo(
        0x1A00,
        (
            Entry(0x6000, 1, 1, "Underrange", 1),
            Entry(0, 0, 7),
            Entry(0x6000, 17, 16, "Value", 0x03),
            Entry(0x6000, 18, 32, "Heat", 0x08),
        ),
        3,
    )
    raw = Inputs(sub_of(5, Direction.INPUT, pdo))
    assert raw.names == ("Underrange", "Value", "Heat")
    tables, _ = opened(raw)
    assert [c.bank for c in tables.input_columns] == [Bank.BIT, Bank.INTEGER, Bank.REAL]
    assert [c.number.kind for c in tables.input_columns][1:] == [NumberKind.SIGNED, NumberKind.REAL]

    volts = Inputs(sub_of(5, Direction.INPUT, pdo), scale={"Value": 10 / 0x7FFF})
    tables, views = opened(volts)
    assert tables.input_columns[1].bank is Bank.REAL
    assert tables.input_columns[1].number.scale == pytest.approx(10 / 0x7FFF)
    views.input_reals[:] = [2.5, 20.0]
    assert volts["Value"] == 2.5


def test_names_of_two_devices_are_distinct() -> None:
    both = Outputs(
        terminal(1, Direction.OUTPUT, 1, "Output"), terminal(4, Direction.OUTPUT, 1, "Output")
    )
    assert both.names == ("1 Channel 1 Output", "4 Channel 1 Output")


def test_nameless_entries_are_numbered() -> None:
    assert unique_names([("", "", "3"), ("", "", "3")]) == ["3 value 1", "3 value 2"]


def test_errors_name_the_channel() -> None:
    sub = terminal(1, Direction.OUTPUT, 2, "Output")
    lamps = Outputs(sub)
    with pytest.raises(RuntimeError, match="before a Loop is open"):
        lamps["Channel 1 Output"] = 1
    with pytest.raises(KeyError, match="the channels are Channel 1 Output"):
        lamps["Channel 9 Output"] = 1
    with pytest.raises(ValueError, match="unknown channel 'Value'"):
        Outputs(sub, scale={"Value": 1.0})
    with pytest.raises(ValueError, match="no output process data"):
        Outputs(terminal(1, Direction.INPUT, 2, "Input"))


def test_a_device_without_assigned_pdos_shows_its_choice() -> None:
    device = replace(servo(1), inputs=())
    sub = SimpleNamespace(position=1, description=device)
    with pytest.raises(ValueError, match="no PDO is assigned; choose with pdos= from 0x1A00"):
        Inputs(sub)
    assert len(Inputs(sub, pdos=[0x1A00]).names) == 5


def test_an_index_that_is_not_a_pdo_is_refused() -> None:
    with pytest.raises(ValueError, match="0x1C12 is not a PDO"):
        Inputs(terminal(1, Direction.INPUT, 1, "Input"), pdos=[0x1C12])


def test_an_empty_list_of_devices_has_its_own_error() -> None:
    """A group is empty if no device has its alias."""
    with pytest.raises(ValueError, match="outputs: no device given"):
        Outputs()
