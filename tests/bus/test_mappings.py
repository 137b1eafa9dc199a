"""Mappings of devices with quirks: read, kept, chosen, written, refused and restored."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from catenary.bus import MainDevice
from catenary.errors import MappingError
from catenary.model.device import DeviceDescription, Direction
from catenary.plan import DeviceRequest, ObjectReference
from catenary.plan.request import DistributedClock, WrittenPdo
from catenary.types import UINT, USINT
from catenary.virtual import AnalogInputs, Coupler, MappingQuirks, Segment, Servo
from catenary.wire.al import AlState
from tests.plan.devices import Asking

STATUS, POSITION = ObjectReference(0x6041, 0, 16), ObjectReference(0x6064, 0, 32)
FOLLOWING_ERROR = ObjectReference(0x60F4, 0, 32)
DEMAND = ObjectReference(0x6062, 0, 32)  # in no PDO of the servo


@contextmanager
def scanned(**quirks: object) -> Iterator[MainDevice]:
    """Yield a coupler and a servo with quirks of its mapping, in PRE-OP."""
    servo = Servo(mapping_quirks=MappingQuirks(**quirks))  # type: ignore[arg-type]
    with MainDevice(Segment([Coupler(), servo])) as main:
        main.scan()
        yield main


def asking(*inputs: ObjectReference, pdos: tuple[WrittenPdo, ...] = ()) -> Asking:
    return Asking({1: DeviceRequest(inputs=inputs, pdos=pdos)})


def assigned(main: MainDevice, index: int) -> list[int]:
    """Return the list 0x1C12 or 0x1C13 of the device itself."""
    sdo = main.subs[1].sdo
    return [sdo.read(index, k + 1, type=UINT) for k in range(sdo.read(index, 0, type=USINT))]


def indices(device: DeviceDescription, direction: Direction) -> list[int]:
    return [pdo.index for each in device.assignments(direction) for pdo in each.pdos]


# -- reading changes nothing ---------------------------------------------------------------------


def test_a_scan_shows_the_mapping_of_the_device_and_notes_that_of_the_sii() -> None:
    with scanned(power_up=(0x1601, 0x1A01)) as main:
        device = main.subs[1].description
        assert indices(device, Direction.OUTPUT) == [0x1601]
        assert indices(device, Direction.INPUT) == [0x1A01]
        assert main.notes == (
            f"{device}: SyncManager 2 carries PDOs 0x1601, but its SII specifies 0x1600",
            f"{device}: SyncManager 3 carries PDOs 0x1A01, but its SII specifies 0x1A00",
        )


def test_a_device_that_agrees_with_its_sii_has_no_notes() -> None:
    with scanned() as main:
        assert main.notes == ()


def test_a_sufficient_mapping_is_not_written() -> None:
    with scanned(power_up=(0x1601, 0x1A01), fixed_pdos="silent", fixed_lists="silent") as main:
        plan = main.plan(asking(STATUS, POSITION))
        assert plan.devices[1].downloads == ()
        main.configure(plan)
        assert main.subs[1].state is AlState.SAFE_OP


# -- fixed PDOs ----------------------------------------------------------------------------------


def test_a_pdo_flagged_as_fixed_is_refused_in_the_plan() -> None:
    with scanned(fixed_pdos="declared") as main:
        with pytest.raises(MappingError, match="all its PDOs are fixed: 0x1A00") as caught:
            main.plan(asking(DEMAND))
        assert "as assigned now (0x1A00): 0x6062:00 (32 bits) is not mapped" in str(caught.value)
        assert "none of its PDOs carries 0x6062:00" in str(caught.value)


def test_access_rights_are_read_from_the_dictionary() -> None:
    """The SII need not flag fixed PDOs, because the access rights are read."""
    wanted = asking(FOLLOWING_ERROR, POSITION, DEMAND, ObjectReference(0x5FFF, 0, 8))
    refused = pytest.raises(MappingError, match="0x1C13 is read-only in its dictionary")
    with scanned(fixed_lists="declared") as main, refused:
        main.plan(wanted)


@pytest.mark.parametrize("code", [0x06010002, 0x08000021])
def test_a_refused_mapping_names_the_alternatives_and_is_restored(code: int) -> None:
    with scanned(fixed_pdos="silent", abort_code=code) as main:
        before = main.subs[1].description
        plan = main.plan(asking(DEMAND))
        with pytest.raises(MappingError) as caught:
            main.configure(plan)
        text = str(caught.value)
        assert "device 1" in text
        assert "the entries of PDO 0x1A00 cannot be changed" in text
        assert f"0x{code:08X}" in text
        assert "as assigned now (0x1A00): 0x6062:00 (32 bits) is not mapped" in text
        assert "pdos=" in text
        assert assigned(main, 0x1C13) == [0x1A00]
        main.read_mappings()
        assert main.subs[1].description.inputs == before.inputs


def test_a_refused_list_of_pdos_is_named() -> None:
    with scanned(fixed_lists="silent") as main:
        plan = main.plan(asking(FOLLOWING_ERROR))
        assert plan.devices[1].changes == (("0x1C13", "0x1A00", "0x1A00, 0x1A02"),)
        with pytest.raises(MappingError, match="its list of PDOs, 0x1C13, cannot be changed"):
            main.configure(plan)
        assert assigned(main, 0x1C13) == [0x1A00]


def test_the_old_mapping_is_restored_if_an_object_cannot_be_mapped() -> None:
    with scanned(refused_objects=(0x6062,)) as main:
        with pytest.raises(MappingError, match=r"0x6062:00 .*cannot be mapped into PDO 0x1A00"):
            main.configure(main.plan(asking(DEMAND)))
        assert assigned(main, 0x1C13) == [0x1A00]
        main.configure(main.plan(asking(POSITION)))


def test_an_sii_without_the_permissions_is_honoured() -> None:
    with scanned(coe_details=0x23) as main:
        with pytest.raises(MappingError, match="does not allow changes of 0x1C13"):
            main.plan(asking(FOLLOWING_ERROR))
        with pytest.raises(MappingError, match="does not allow changes of PDO entries"):
            main.plan(asking(DEMAND))
        main.configure(main.plan(asking(POSITION)))


def test_a_mapping_of_the_application_is_tried_against_the_sii() -> None:
    written = (WrittenPdo(0x1A00, (STATUS, DEMAND)), WrittenPdo(0x1A03))
    with scanned(coe_details=0x23) as main:
        plan = main.plan(asking(DEMAND, pdos=written))
        main.configure(plan)
        assert assigned(main, 0x1C13) == [0x1A00, 0x1A03]
        assert main.subs[1].sdo.read(0x1A00, 0, type=USINT) == 2


def test_pdos_that_exclude_each_other_are_replaced() -> None:
    """The device refuses 0x1A00 in addition to 0x1A01 with 0x08000021."""
    with scanned(power_up=(0x1601, 0x1A01), exclusive=True, fixed_pdos="declared") as main:
        torque = ObjectReference(0x6077, 0, 16)
        plan = main.plan(asking(STATUS, POSITION, torque))
        assert plan.devices[1].changes == (("0x1C13", "0x1A01", "0x1A00"),)
        main.configure(plan)
        assert assigned(main, 0x1C13) == [0x1A00]


def test_optional_objects_are_omitted_if_the_device_refuses_them() -> None:
    optional = [ObjectReference(index, 0, 32, required=False) for index in (0x6062, 0x60F4)]
    with scanned(fixed_pdos="silent", fixed_lists="silent") as main:
        plan = main.plan(asking(POSITION, *optional))
        assert plan.devices[1].downloads == ()
        assert plan.devices[1].left_out == ("0x6062:00", "0x60F4:00")
        assert "not exchanged (optional): 0x6062:00, 0x60F4:00" in str(plan)
        main.configure(plan)


def test_a_plan_shows_what_would_change_with_old_and_new_values() -> None:
    with scanned() as main:
        request = DeviceRequest(inputs=(FOLLOWING_ERROR,), start_up=((0x6060, 0, b"\x08"),))
        plan = main.plan(Asking({1: request}))
        assert "0x1C13  0x1A00 → 0x1A00, 0x1A02" in str(plan)
        assert "0x6060:00  00 → 08" in str(plan)


def test_a_plan_shows_the_synchronisation_of_a_device() -> None:
    with scanned() as main:
        plan = main.plan(Asking({1: DeviceRequest(clock=DistributedClock())}))
        changes = {c.what: (c.old, c.new) for c in plan.devices[1].changes}
        assert changes["0x1C32:01"] == ("00 00", "02 00")
        assert all(old for old, _ in changes.values())


# -- one object mapped twice ---------------------------------------------------------------------


def test_an_object_mapped_twice_has_a_place_for_each_pdo() -> None:
    with MainDevice(Segment([Coupler(), AnalogInputs(channels=1, second_pdo="twice")])) as main:
        main.scan()
        request = asking(ObjectReference(0x6000, 0x11, 16), ObjectReference(0x6000, 0x11, 8))
        plan = main.plan(request)
        assert plan.devices[1].downloads == ()
        main.configure(plan)
