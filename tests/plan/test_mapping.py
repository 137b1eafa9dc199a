"""Mappings: kept, chosen among what is offered, rewritten, refused with the object named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import MappingError
from catenary.model.device import (
    DeviceDescription,
    Direction,
    Entry,
    ObjectInformation,
    Pdo,
    mapped_entries,
)
from catenary.plan import make_plan
from catenary.plan.mapping import make_mapping
from catenary.plan.start_up import Download, mapping_downloads
from catenary.plan.wish import ObjectReference
from tests.plan.devices import SERVO_INPUTS, asks, coupler, demo, lamps, servo

FOLLOWING_ERROR = ObjectReference(0x60F4, 0, 32)
POSITION = ObjectReference(0x6064, 0, 32)


def test_what_is_mapped_stays() -> None:
    mapping = make_mapping(servo(0), Direction.INPUT, [POSITION])
    assert not mapping.changed
    assert mapping_downloads(mapping) == ()


def test_an_offered_pdo_is_assigned_before_one_is_rewritten() -> None:
    mapping = make_mapping(offering(servo(0)), Direction.INPUT, [POSITION, FOLLOWING_ERROR])
    assert [pdo.index for pdo in mapping.assignments[0].pdos] == [0x1A00, 0x1A01]
    assert mapping_downloads(mapping) == (
        Download(0x1C13, 0, b"\x00"),
        Download(0x1C13, 1, b"\x00\x1a"),
        Download(0x1C13, 2, b"\x01\x1a"),
        Download(0x1C13, 0, b"\x02"),
    )


def test_a_missing_object_is_appended() -> None:
    mapping = make_mapping(servo(0), Direction.INPUT, [FOLLOWING_ERROR])
    entry = Entry(0x60F4, 0, 32)
    assert mapping.assignments[0].pdos[0].entries == (*SERVO_INPUTS, entry)
    downloads = mapping_downloads(mapping)
    assert downloads[0] == Download(0x1C13, 0, b"\x00")
    assert downloads[1] == Download(0x1A00, 0, b"\x00")
    assert downloads[2] == Download(0x1A00, 1, b"\x10\x00\x41\x60", SERVO_INPUTS[0])
    assert downloads[7] == Download(0x1A00, 6, b"\x20\x00\xf4\x60", entry)
    assert downloads[8:] == (
        Download(0x1A00, 0, b"\x06"),
        Download(0x1C13, 1, b"\x00\x1a"),
        Download(0x1C13, 0, b"\x01"),
    )


def test_fixed_pdos_refuse_and_say_what_there_is() -> None:
    with pytest.raises(MappingError, match=r"device 0 \(Servo\): object 0x60F4:00") as caught:
        make_mapping(servo(0, fixed=True), Direction.INPUT, [FOLLOWING_ERROR])
    assert "fixed" in caught.value.message
    assert "0x6064:00" in caught.value.hint


def test_fixed_pdos_keep_what_they_have_where_the_rest_is_not_required() -> None:
    wished = [POSITION, replace(FOLLOWING_ERROR, required=False)]
    assert not make_mapping(servo(0, fixed=True), Direction.INPUT, wished).changed


def test_without_coe_nothing_changes() -> None:
    with pytest.raises(MappingError, match="no CoE mailbox"):
        make_mapping(servo(0, coe=False), Direction.INPUT, [FOLLOWING_ERROR])
    with pytest.raises(MappingError, match="0x7050:01"):
        make_mapping(lamps(0), Direction.OUTPUT, [ObjectReference(0x7050, 1, 1)])


def test_a_device_without_process_data_says_so() -> None:
    with pytest.raises(MappingError, match="no CoE mailbox"):
        make_mapping(coupler(0), Direction.INPUT, [FOLLOWING_ERROR])


def test_a_wrong_length_is_told() -> None:
    with pytest.raises(MappingError, match="32 bits, 16 were wished"):
        make_mapping(servo(0), Direction.INPUT, [ObjectReference(0x6064, 0, 16)])


@pytest.mark.parametrize(
    ("known", "match"),
    [
        (ObjectInformation(0x60F4, 0, 0), "does not exist"),
        (ObjectInformation(0x60F4, 0, 32, input_mappable=False), "cannot be mapped"),
        (ObjectInformation(0x60F4, 0, 16), "has 16 bits, 32 were wished"),
    ],
)
def test_what_the_dictionary_says_is_believed(known: ObjectInformation, match: str) -> None:
    device = replace(servo(0), objects=(known,))
    with pytest.raises(MappingError, match=match):
        make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])


def test_a_pdo_that_would_map_an_object_twice_is_passed_over() -> None:
    overlapping = Pdo(0x1A01, (SERVO_INPUTS[0], Entry(0x60F4, 0, 32)), None, fixed=True)
    device = servo(0)
    device = replace(device, input_pdos=(*device.input_pdos, overlapping))
    mapping = make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])
    assert [pdo.index for pdo in mapping.rewritten] == [0x1A00]


def test_too_much_for_a_datagram() -> None:
    wished = [ObjectReference(0x2000 + k, 0, 64) for k in range(190)]
    with pytest.raises(MappingError, match="do not fit"):
        make_mapping(servo(0), Direction.INPUT, wished)


def test_a_changed_mapping_moves_what_follows() -> None:
    plan = make_plan(demo(), [asks(3, inputs=((0x60F4, 0, 32),))])
    assert plan.devices[3].mapping_changed
    assert plan.devices[3].layout.input_size == 17
    assert plan.devices[4].layout.input_offset == 13 + 17
    assert plan.layout.input(3, 0x60F4, 0) is not None


def offering(device: DeviceDescription) -> DeviceDescription:
    """With a second TxPDO that is not assigned."""
    extra = Pdo(0x1A01, (Entry(0x60F4, 0, 32),), None, fixed=True)
    return replace(device, input_pdos=(*device.input_pdos, extra))


def test_what_is_not_required_is_added_one_by_one() -> None:
    """One optional object that cannot be mapped does not take the others with it."""
    missing = ObjectReference(0x6FFF, 0, 16, required=False)
    wanted = replace(FOLLOWING_ERROR, required=False)
    device = replace(servo(0), objects=(ObjectInformation(0x6FFF, 0, 0),))
    mapping = make_mapping(device, Direction.INPUT, [POSITION, missing, wanted])
    mapped = [(entry.index, entry.subindex) for entry in mapped_entries(mapping.assignments)]
    assert (0x60F4, 0) in mapped
    assert (0x6FFF, 0) not in mapped
