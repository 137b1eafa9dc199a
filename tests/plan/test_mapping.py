"""Mappings: unchanged, chosen from the offered PDOs, rewritten, specified, or refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Direction,
    Entry,
    ObjectInformation,
    ObjectValue,
    Pdo,
    mapped_entries,
)
from catenary.plan import make_plan
from catenary.plan.mapping import make_mapping
from catenary.plan.request import DeviceRequest, ObjectReference, WrittenPdo
from catenary.plan.start_up import Download, mapping_downloads
from tests.plan.devices import SERVO_INPUTS, Asking, asks, coupler, demo, lamps, servo

FOLLOWING_ERROR = ObjectReference(0x60F4, 0, 32)
POSITION = ObjectReference(0x6064, 0, 32)


def test_a_sufficient_mapping_stays() -> None:
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


def test_an_error_names_each_alternative_and_why_it_failed() -> None:
    with pytest.raises(MappingError) as caught:
        make_mapping(servo(0, fixed=True), Direction.INPUT, [FOLLOWING_ERROR])
    assert caught.value.message.splitlines() == [
        "device 0 (Servo): its inputs cannot carry 0x60F4:00 (32 bits):",
        "    as assigned now (0x1A00): 0x60F4:00 (32 bits) is not mapped",
        "    another combination of its PDOs: none of its PDOs carries 0x60F4:00 (32 bits)",
        "    rewriting a PDO: all its PDOs are fixed: 0x1A00",
    ]
    assert "0x6064:00" in caught.value.hint
    assert "pdos=" in caught.value.hint


def may(device: DeviceDescription, **permissions: bool) -> DeviceDescription:
    assert device.mailbox is not None
    return replace(device, mailbox=replace(device.mailbox, **permissions))


def test_a_device_that_denies_pdo_configuration_is_not_rewritten() -> None:
    device = may(servo(0), pdo_configuration=False)
    with pytest.raises(MappingError, match="its SII does not allow changes of PDO entries"):
        make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])


def test_a_device_that_denies_pdo_assignment_keeps_its_pdos() -> None:
    device = may(offering(servo(0, fixed=True)), pdo_assign=False)
    with pytest.raises(MappingError, match="its SII does not allow changes of 0x1C13"):
        make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])


def test_a_device_that_denies_pdo_assignment_gets_no_other_pdo_to_rewrite() -> None:
    device = servo(0, fixed=True)
    free = Pdo(0x1A01, (), None)
    device = may(replace(device, input_pdos=(*device.input_pdos, free)), pdo_assign=False)
    with pytest.raises(MappingError, match="are fixed, and no other PDO can be assigned"):
        make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])


def test_a_list_that_the_dictionary_calls_read_only_is_not_written() -> None:
    device = offering(servo(0))
    [assignment] = device.inputs
    device = replace(device, inputs=(replace(assignment, fixed=True),))
    mapping = make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])
    assert mapping.reassigned == ()
    downloads = mapping_downloads(mapping)
    assert {step.index for step in downloads} == {0x1A00}


@pytest.mark.parametrize("offered", [False, True])
def test_an_optional_object_never_causes_a_write(offered: bool) -> None:
    wanted = [POSITION, replace(FOLLOWING_ERROR, required=False)]
    device = offering(servo(0)) if offered else servo(0)
    mapping = make_mapping(device, Direction.INPUT, wanted)
    assert not mapping.changed
    assert mapping.left_out == (wanted[1],)


def test_an_optional_object_that_is_mapped_with_another_length_is_not_left_out() -> None:
    """`Drives` uses it as it is."""
    torque = ObjectReference(0x6077, 0, 32, required=False)  # 16 bits are mapped
    mapping = make_mapping(servo(0), Direction.INPUT, [POSITION, torque])
    assert not mapping.changed
    assert mapping.left_out == ()


def test_a_rewrite_for_a_required_object_leaves_optional_ones_out() -> None:
    """The device could refuse them, though it would take the required one."""
    other = ObjectReference(0x60FD, 0, 32, required=False)
    mapping = make_mapping(servo(0), Direction.INPUT, [FOLLOWING_ERROR, other])
    [pdo] = mapping.rewritten
    assert [entry.index for entry in pdo.entries[-2:]] == [0x6077, 0x60F4]
    assert mapping.left_out == (other,)
    assert [reason.split(" (")[0] for reason in mapping.rejected] == [
        "as assigned now",
        "another combination of its PDOs: none of its PDOs carries 0x60F4:00",
    ]


def test_a_specified_mapping_ignores_the_permissions_of_the_sii() -> None:
    device = may(servo(0, fixed=True), pdo_configuration=False, pdo_assign=False)
    written = [WrittenPdo(0x1A00, (POSITION, FOLLOWING_ERROR))]
    mapping = make_mapping(device, Direction.INPUT, [POSITION], written)
    assert [(e.index, e.name) for e in mapping.rewritten[0].entries] == [
        (0x6064, "Position"),
        (0x60F4, ""),
    ]
    assert mapping_downloads(mapping)


def test_a_written_mapping_that_the_device_has_changes_nothing() -> None:
    mapping = make_mapping(servo(0), Direction.INPUT, [POSITION], [WrittenPdo(0x1A00)])
    assert not mapping.changed


def test_a_written_mapping_without_a_required_object_is_refused() -> None:
    written = [WrittenPdo(0x1A00, (FOLLOWING_ERROR,))]
    with pytest.raises(MappingError, match=r"as specified \(0x1A00\): 0x6064:00 \(32 bits\)"):
        make_mapping(servo(0), Direction.INPUT, [POSITION], written)


def test_an_unknown_pdo_needs_its_entries() -> None:
    with pytest.raises(MappingError, match="neither its dictionary nor its SII has PDO 0x1A07"):
        make_mapping(servo(0), Direction.INPUT, [POSITION], [WrittenPdo(0x1A07)])


def test_an_object_mapped_twice_with_different_sizes_is_accepted() -> None:
    """EL3632: 0x6000:02."""
    device = servo(0)
    short = Pdo(0x1A01, (Entry(0x6064, 0, 16),), 3)
    pdos = (*device.input_pdos, short)
    device = replace(device, inputs=(Assignment(3, pdos),), input_pdos=pdos)
    for bits in (16, 32):
        wanted = [ObjectReference(0x6064, 0, bits)]
        assert not make_mapping(device, Direction.INPUT, wanted).changed


def test_fixed_pdos_stay_if_the_missing_objects_are_optional() -> None:
    requested = [POSITION, replace(FOLLOWING_ERROR, required=False)]
    assert not make_mapping(servo(0, fixed=True), Direction.INPUT, requested).changed


def test_without_coe_nothing_changes() -> None:
    with pytest.raises(MappingError, match="no CoE mailbox"):
        make_mapping(servo(0, coe=False), Direction.INPUT, [FOLLOWING_ERROR])
    with pytest.raises(MappingError, match="0x7050:01"):
        make_mapping(lamps(0), Direction.OUTPUT, [ObjectReference(0x7050, 1, 1)])


def test_a_device_without_process_data_is_reported() -> None:
    with pytest.raises(MappingError, match="no CoE mailbox"):
        make_mapping(coupler(0), Direction.INPUT, [FOLLOWING_ERROR])


def test_a_wrong_length_is_reported() -> None:
    with pytest.raises(
        MappingError, match="is mapped with 32 bits, but 16 were requested"
    ) as caught:
        make_mapping(servo(0), Direction.INPUT, [ObjectReference(0x6064, 0, 16)])
    assert "0x6064:00 is already mapped with 32 bits" in caught.value.message


@pytest.mark.parametrize(
    ("known", "match"),
    [
        (ObjectInformation(0x60F4, 0, 0), "does not exist"),
        (ObjectInformation(0x60F4, 0, 32, input_mappable=False), "cannot be mapped"),
        (ObjectInformation(0x60F4, 0, 16), "has 16 bits, but 32 were requested"),
    ],
)
def test_the_dictionary_decides_on_a_mapping(known: ObjectInformation, match: str) -> None:
    device = replace(servo(0), objects=(known,))
    with pytest.raises(MappingError, match=match):
        make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])


def test_mutually_exclusive_pdos_are_exchanged() -> None:
    other = Pdo(0x1A01, (SERVO_INPUTS[0], Entry(0x60F4, 0, 32)), None, fixed=True)
    device = servo(0)
    device = replace(device, input_pdos=(*device.input_pdos, other))
    mapping = make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])
    assert mapping.assignments[0].pdos == (other,)
    assert mapping.rewritten == ()


def test_a_mandatory_pdo_is_rewritten_rather_than_exchanged() -> None:
    device = servo(0)
    first = replace(device.input_pdos[0], mandatory=True)
    other = Pdo(0x1A01, (SERVO_INPUTS[0], Entry(0x60F4, 0, 32)), None, fixed=True)
    device = replace(device, inputs=(Assignment(3, (first,)),), input_pdos=(first, other))
    mapping = make_mapping(device, Direction.INPUT, [FOLLOWING_ERROR])
    assert [pdo.index for pdo in mapping.rewritten] == [0x1A00]


def test_a_mapping_that_exceeds_a_datagram_is_refused() -> None:
    requested = [ObjectReference(0x2000 + k, 0, 64) for k in range(190)]
    with pytest.raises(MappingError, match="do not fit"):
        make_mapping(servo(0), Direction.INPUT, requested)


def test_a_changed_mapping_moves_the_following_objects() -> None:
    plan = make_plan(demo(), [asks(3, inputs=((0x60F4, 0, 32),))])
    assert plan.devices[3].mapping_changed
    assert plan.devices[3].layout.input_size == 17
    assert plan.devices[4].layout.input_offset == 13 + 17
    assert plan.layout.input(3, 0x60F4, 0) is not None


def offering(device: DeviceDescription) -> DeviceDescription:
    """With a second TxPDO that is not assigned."""
    extra = Pdo(0x1A01, (Entry(0x60F4, 0, 32),), None, fixed=True)
    return replace(device, input_pdos=(*device.input_pdos, extra))


def test_optional_objects_are_taken_one_by_one() -> None:
    """One optional object that no PDO carries does not take the others with it."""
    required = ObjectReference(0x60FD, 0, 32)
    missing = ObjectReference(0x6FFF, 0, 16, required=False)
    wanted = replace(FOLLOWING_ERROR, required=False)
    device = offering(servo(0))
    device = replace(
        device, input_pdos=(*device.input_pdos, Pdo(0x1A02, (Entry(0x60FD, 0, 32),), None))
    )
    mapping = make_mapping(device, Direction.INPUT, [POSITION, required, missing, wanted])
    mapped = [(entry.index, entry.subindex) for entry in mapped_entries(mapping.assignments)]
    assert (0x60F4, 0) in mapped
    assert mapping.left_out == (missing,)


def test_a_plan_shows_old_and_new_values() -> None:
    devices = demo()
    devices[3] = replace(devices[3], values=(ObjectValue(0x6060, 0, b"\x01"),))
    request = DeviceRequest(
        inputs=(FOLLOWING_ERROR,), start_up=((0x6060, 0, b"\x08"), (0x6065, 0, b"\x01\x02"))
    )
    plan = make_plan(devices, [Asking({3: request})])
    before = "0x6041:00/16, 0x6061:00/8, 0x606C:00/32, 0x6064:00/32, 0x6077:00/16"
    assert plan.devices[3].changes == (
        ("0x1A00", before, f"{before}, 0x60F4:00/32"),
        ("0x6060:00", "01", "08"),
        ("0x6065:00", "", "01 02"),
    )
    assert "0x6060:00  01 → 08" in str(plan)
    assert "0x6065:00  (not read) → 01 02" in str(plan)


def test_two_requests_may_not_write_down_different_pdos() -> None:
    first = Asking({3: DeviceRequest(pdos=(WrittenPdo(0x1A00), WrittenPdo(0x1600)))})
    second = Asking({3: DeviceRequest(pdos=(WrittenPdo(0x1A01),))})
    with pytest.raises(ConfigurationError, match="different PDOs for inputs"):
        make_plan(demo(), [first, second])
    make_plan(demo(), [first, first])
