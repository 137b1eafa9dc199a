"""Start-up objects in a plan: order, types, contradictions."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary import types
from catenary.errors import ConfigurationError, MappingError
from catenary.model.device import Entry, ObjectInformation, ObjectValue
from catenary.plan.pdo_mapping import Mapping
from catenary.plan.planner import Plan, make_plan
from catenary.plan.request import DeviceRequest, ObjectReference
from catenary.plan.start_up import mapping_downloads
from catenary.plan.start_up_object import StartUp
from tests.plan.devices import Asking, demo

FOLLOWING_ERROR = ObjectReference(0x60F4, 0, 32)


def plan_of(*requests: DeviceRequest, objects: tuple[ObjectInformation, ...] = ()) -> Plan:
    """Return a plan for the demo's servo at position 3, with these objects in its dictionary."""
    devices = demo()
    value = ObjectValue(0x6065, 0, b"\x88\x13\x00\x00")
    devices[3] = replace(devices[3], objects=objects, values=(value,))
    return make_plan(devices, [Asking({3: request}) for request in requests])


def places(plan: Plan) -> list[tuple[int, int]]:
    return [(d.index, d.subindex) for d in plan.devices[3].downloads]


def test_the_order_of_writing() -> None:
    plan = plan_of(
        DeviceRequest(
            inputs=(FOLLOWING_ERROR,),
            start_up=((0x6060, 0, b"\x08"),),
            objects=(
                StartUp(0x6065, 0, 5, type=types.UDINT),
                StartUp(0x2100, 0, b"\x01", before_mapping=True, verify=False),
            ),
        )
    )
    written = places(plan)
    assert written[0] == (0x2100, 0)
    assert written[-2:] == [(0x6060, 0), (0x6065, 0)]
    assert {index for index, _ in written[1:-2]} == {0x1A00, 0x1C13}
    text = str(plan)
    section = text[text.index("start-up:") :].splitlines()
    assert [line.split()[0] for line in section[2:6]] == ["before", "mapping", "Catenary", "yours"]
    assert section[2].endswith("0x2100:00  (not read) → 01, not verified")
    assert section[5].endswith("0x6065:00  88 13 00 00 → 5 (UDINT)")


def test_an_unchanged_value_is_marked() -> None:
    plan = plan_of(DeviceRequest(objects=(StartUp(0x6065, 0, 5000, type=types.UDINT),)))
    assert "0x6065:00  5000 (UDINT) (unchanged)" in str(plan)


def test_without_downloads_there_is_no_section() -> None:
    assert "start-up:" not in str(plan_of(DeviceRequest()))


def test_the_type_comes_from_the_dictionary() -> None:
    known = ObjectInformation(0x6065, 0, 32, types.UDINT.index)
    plan = plan_of(DeviceRequest(objects=(StartUp(0x6065, 0, 20_000),)), objects=(known,))
    [download] = plan.devices[3].downloads
    assert (download.data, download.text) == (b"\x20\x4e\x00\x00", "20000 (UDINT)")
    assert download.verify


@pytest.mark.parametrize(
    ("objects", "why"),
    [
        ((), "the object dictionary does not describe it"),
        ((ObjectInformation(0x6065, 0, 0),), "the object dictionary does not describe it"),
        ((ObjectInformation(0x6065, 0, 32),), r"does not report its data type \(32 bits\)"),
        ((ObjectInformation(0x6065, 0, 16, 0x0800),), "0x0800 is not a base data type"),
    ],
)
def test_an_unknown_type(objects: tuple[ObjectInformation, ...], why: str) -> None:
    with pytest.raises(
        ConfigurationError,
        match=rf"device 3 .*type of start-up object 0x6065:00 is unknown: .*{why}",
    ) as caught:
        plan_of(DeviceRequest(objects=(StartUp(0x6065, 0, 1),)), objects=objects)
    assert "type=types.UDINT" in str(caught.value.hint)


def test_bytes_need_no_type() -> None:
    plan = plan_of(DeviceRequest(objects=(StartUp(0x6065, 0, b"\x01\x02"),)))
    assert plan.devices[3].downloads[0].data == b"\x01\x02"


def test_write_only_objects_are_not_verified() -> None:
    known = ObjectInformation(0x2100, 0, 16, types.UINT.index, readable=False)
    plan = plan_of(DeviceRequest(objects=(StartUp(0x2100, 0, 1),)), objects=(known,))
    assert not plan.devices[3].downloads[0].verify


def test_a_value_of_another_kind_names_the_object() -> None:
    with pytest.raises(ValueError, match=r"start-up object 0x6065:00: -1 is not a value of UDINT"):
        StartUp(0x6065, 0, -1, type=types.UDINT)
    with pytest.raises(TypeError, match=r"0x6065:00: 1\.5 is not a value of UDINT"):
        StartUp(0x6065, 0, 1.5, type=types.UDINT)
    with pytest.raises(TypeError, match="0x2000:00: 5 is not a value of VISIBLE_STRING"):
        StartUp(0x2000, 0, 5, type=types.VISIBLE_STRING)
    with pytest.raises(ValueError, match="an index has 16 bits"):
        StartUp(0x16065, 0, b"")
    with pytest.raises(TypeError, match="index and subindex must be numbers, not '0x6065' and 0"):
        StartUp("0x6065", 0, 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"0x6065:00: 'UDINT' is not a type of catenary\.types"):
        StartUp(0x6065, 0, 5, type="UDINT")  # type: ignore[arg-type]


@pytest.mark.parametrize("index", [0x1600, 0x17FF, 0x1A00, 0x1BFF, 0x1C12, 0x1C13])
@pytest.mark.parametrize("before_mapping", [True, False])
def test_start_up_objects_cannot_change_the_mapping(index: int, before_mapping: bool) -> None:
    with pytest.raises(ValueError, match=rf"0x{index:04X}:00 is part of the PDO mapping.*pdos="):
        StartUp(index, 0, b"\x00", before_mapping=before_mapping)


def test_objects_next_to_the_mapping_are_allowed() -> None:
    assert StartUp(0x1800, 6, b"\x00").index == 0x1800
    assert StartUp(0x1C32, 1, b"\x02").index == 0x1C32


def test_a_device_without_objects_cannot_have_any() -> None:
    request = DeviceRequest(objects=(StartUp(0x2000, 0, b"\x01"),))
    with pytest.raises(
        ConfigurationError, match=r"device 0 .*start-up object 0x2000:00 .*has no CoE mailbox"
    ):
        make_plan(demo(), [Asking({0: request})])


def test_two_requests_may_agree_but_not_contradict() -> None:
    first = StartUp(0x6065, 0, 5, type=types.UDINT)
    twice = DeviceRequest(objects=(first,))
    assert len(plan_of(twice, twice).devices[3].downloads) == 1
    other = DeviceRequest(objects=(replace(first, value=6),))
    with pytest.raises(
        ConfigurationError, match=r"different values to start-up object 0x6065:00: 5 and 6"
    ):
        plan_of(twice, other)


def test_one_list_may_write_an_object_twice() -> None:
    """Some devices are unlocked by two values, one after the other."""
    keys = (StartUp(0x2100, 0, b"\x01"), StartUp(0x2100, 0, b"\x02"))
    plan = plan_of(DeviceRequest(objects=keys))
    assert [d.data for d in plan.devices[3].downloads] == [b"\x01", b"\x02"]


def test_an_entry_too_long_for_a_mapping_object_is_not_written() -> None:
    [pdo] = demo()[3].inputs[0].pdos
    long = replace(pdo, entries=(Entry(0x6000, 1, 0x180),))  # 0x80 bits of subindex 2 otherwise
    assigned = replace(demo()[3].inputs[0], pdos=(long,))
    with pytest.raises(MappingError, match=r"0x6000:01 \(384 bits\) is longer than 255 bits"):
        mapping_downloads(Mapping((assigned,), rewritten=(long,)))


def test_complete_access_needs_the_bytes_from_subindex_0_or_1_on() -> None:
    with pytest.raises(ValueError, match="begins at subindex 0 or 1"):
        StartUp(0x2000, 2, b"\x01", complete_access=True)
    with pytest.raises(TypeError, match="needs the bytes of all subindices"):
        StartUp(0x2000, 0, 1, complete_access=True)
