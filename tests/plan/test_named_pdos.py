"""Choice of PDOs by name, and the rules of an ESI: each broken rule is named with its place."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import MappingError
from catenary.esi.apply import applied
from catenary.model.device import DeviceDescription, Direction, Pdo
from catenary.plan.mapping import make_mapping
from catenary.plan.named_pdos import pdos_named
from catenary.plan.request import ObjectReference, WrittenPdo
from tests.esi import devices as esi
from tests.plan.devices import servo

STATUS = ObjectReference(0x6041, 0, 16)


def drive(**rules: dict[str, object]) -> DeviceDescription:
    """Return a servo with its ESI. `rules` are fields of its PDOs, by "x1A00"."""
    device = applied(servo(0), esi.servo())

    def changed(pdo: Pdo) -> Pdo:
        return replace(pdo, **rules.get(f"x{pdo.index:04X}", {}))  # type: ignore[arg-type]

    return replace(
        device,
        output_pdos=tuple(map(changed, device.output_pdos)),
        input_pdos=tuple(map(changed, device.input_pdos)),
    )


def chosen(device: DeviceDescription, *names: str) -> list[WrittenPdo]:
    found = [pdo for name in names for pdo in pdos_named(device, name)]
    return [pdo for pdo in found if pdo.direction is Direction.INPUT]


def refusal(device: DeviceDescription, written: list[WrittenPdo]) -> str:
    with pytest.raises(MappingError) as caught:
        make_mapping(device, Direction.INPUT, [], written)
    return str(caught.value)


def test_a_mapping_has_pdos_of_both_directions_with_their_sync_managers() -> None:
    written = pdos_named(drive(), "compact")
    assert [(each.sync_manager, each.index) for each in written] == [
        (2, 0x1601),
        (3, 0x1A01),
        (3, 0x1A02),
    ]
    mapping = make_mapping(drive(), Direction.INPUT, [], chosen(drive(), "Compact"))
    assert [pdo.index for pdo in mapping.pdos] == [0x1A01, 0x1A02]
    assert mapping.source == "ESI drive.xml:80"


def test_every_broken_rule_is_named() -> None:
    device = drive(x1A02={"mandatory": True}, x1A00={"excluded_sync_managers": frozenset({3})})
    written = [replace(each, sync_manager=3) for each in chosen(device, "Inputs", "Inputs compact")]
    written[1] = replace(written[1], entries=(STATUS,))
    text = refusal(device, written)
    for broken in (
        "0x1A01 'Inputs compact' excludes 0x1A00 'Inputs': drive.xml:44",
        "0x1A02 'Torque' is mandatory: drive.xml:46",
        "0x1A00 'Inputs' cannot be in SyncManager 3: drive.xml:40",
    ):
        assert broken in text


def test_the_entries_of_a_fixed_pdo_cannot_be_changed() -> None:
    device = drive(x1A00={"fixed": True})
    written = [replace(each, entries=(STATUS,)) for each in chosen(device, "Inputs")]
    assert "0x1A00 'Inputs' is fixed: its entries cannot be changed: drive.xml:40" in refusal(
        device, written
    )


def test_numbers_are_tried_against_the_rules() -> None:
    written = [WrittenPdo(0x1A00), WrittenPdo(0x1A01)]
    mapping = make_mapping(drive(), Direction.INPUT, [], written)
    assert [pdo.index for pdo in mapping.pdos] == [0x1A00, 0x1A01]


def test_a_name_of_several_pdos_is_refused_with_their_numbers() -> None:
    device = drive(x1A02={"name": "Inputs"})
    with pytest.raises(MappingError, match="2 PDOs have the name 'inputs': 0x1A00, 0x1A02"):
        pdos_named(device, "inputs")
