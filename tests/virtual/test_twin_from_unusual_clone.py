"""Twins of devices that differ from the usual: without descriptions, long values, switches."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, SdoAbort
from catenary.procedure.alias import write_alias
from catenary.procedure.sii_owner import with_eeprom
from catenary.virtual import Coupler, Segment, Servo
from catenary.virtual.coe.information import InformationServer
from catenary.virtual.scheduler import Scheduler
from catenary.wire.sdo_information import Access
from tests.virtual.test_twin_from_clone import TURN, and_again, edited, twin_of, with_entry


class Undescribed(Servo):
    """A servo that neither lists nor describes its objects."""

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        dictionary = self.application.dictionary
        self.application._information = InformationServer(dictionary, size=122, supported=False)


def test_a_drive_without_descriptions_moves_and_maps(tmp_path: Path) -> None:
    """Its clone has no object of CiA 402, and only the entries of its PDOs that are in use."""
    first, second = and_again(Segment([Undescribed(serial=1)]), tmp_path)
    assert first.devices[0].object(0x6041) is None
    assert first == second
    segment = Segment.from_clone(tmp_path / "first")
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=TURN, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.2))
            assert twin_of(segment, 0).axis_position() == pytest.approx(0.2, abs=5e-3)
    with cat.MainDevice(segment) as main:
        [sub] = main.scan()
        for index, values in ((0x1600, (0x6040_0010, 0x607A_0020)), (0x1C12, (0x1600, 0x1602))):
            size = 4 if index == 0x1600 else 2
            sub.sdo.write(index, 0, b"\0")
            for subindex, value in enumerate(values, start=1):
                sub.sdo.write(index, subindex, value.to_bytes(size, "little"))
            sub.sdo.write(index, 0, b"\2")
            assert sub.sdo.read(index, 0) == b"\2"


@pytest.mark.parametrize(("subindex", "data"), [(0, b""), (0, bytes(2)), (1, bytes(3))])
def test_a_wrong_length_for_a_mapping_is_refused(
    tmp_path: Path, subindex: int, data: bytes
) -> None:
    """Without a description, the length of the entry in the clone is not that of its type."""
    cat.clone(Segment([Coupler(), Servo(serial=1)]), tmp_path / "first", pre_op=True)
    edited(
        tmp_path / "first",
        tmp_path / "line",
        lambda device: with_entry(device, 0x1600, subindex, data_type=0),
    )
    with cat.MainDevice(Segment.from_clone(tmp_path / "line")) as main:
        sub = main.scan()[1]
        sub.sdo.write(0x1600, 0, b"\0")
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.write(0x1600, subindex, data)
        assert caught.value.code == 0x0607_0010


def test_complete_access_cuts_a_value_that_is_too_long(tmp_path: Path) -> None:
    cat.clone(Segment([Coupler(), Servo(serial=1)]), tmp_path / "first", pre_op=True)
    edited(
        tmp_path / "first",
        tmp_path / "line",
        lambda device: with_entry(device, 0x1018, 4, value=b"\xff" * 8),
    )
    with cat.MainDevice(Segment.from_clone(tmp_path / "line")) as main:
        sdo = main.scan()[1].sdo
        assert sdo.read(0x1018, 4) == b"\xff" * 8
        whole = sdo.read(0x1018, 0, complete=True)
    assert (len(whole), whole[-4:]) == (18, b"\xff" * 4)


@pytest.mark.parametrize("index", [0x6072, 0x607A])
def test_a_value_longer_than_its_description_is_cut(tmp_path: Path, index: int) -> None:
    """Both objects have at most 32 bits, and the clone has 12 bytes."""
    cat.clone(Segment([Coupler(), Servo(serial=1)]), tmp_path / "first", pre_op=True)
    value = b"\1\2" + bytes(9) + b"\xff"
    edited(
        tmp_path / "first",
        tmp_path / "line",
        lambda device: with_entry(device, index, 0, value=value),
    )
    twin = twin_of(Segment.from_clone(tmp_path / "line"), 1)
    found = twin.read_object(index)
    assert found == value[: len(found)]


def test_a_new_alias_is_used_after_a_power_cycle(tmp_path: Path) -> None:
    cat.clone(Segment([Servo(serial=1, alias=3)]), tmp_path / "line", pre_op=True)
    segment = Segment.from_clone(tmp_path / "line")
    with cat.MainDevice(segment) as main:
        [sub] = main.scan()
        main.converse(with_eeprom(sub.station, write_alias(sub.station, 9)))
    segment[0].power_off()
    segment[0].power_on()
    with cat.MainDevice(segment) as main:
        assert main.scan()[0].alias == 9


def test_the_alias_of_a_switch_is_kept(tmp_path: Path) -> None:
    """A switch sets the register, but not the EEPROM."""
    source = Segment([Servo(serial=1, alias=3)])
    source[0].write_alias(5)
    cat.clone(source, tmp_path / "line", pre_op=True)
    segment = Segment.from_clone(tmp_path / "line")
    segment[0].power_off()
    segment[0].power_on()
    with cat.MainDevice(segment) as main:
        assert main.scan()[0].alias == 5


def test_objects_are_readable_in_the_states_of_the_clone(tmp_path: Path) -> None:
    """0x2102 is readable in PRE-OP only. 0x1009 has a value, although no right is stated."""
    cat.clone(Segment([Coupler(), Servo(serial=1)]), tmp_path / "first", pre_op=True)
    edited(
        tmp_path / "first",
        tmp_path / "line",
        lambda device: with_entry(
            with_entry(device, 0x2102, 0, access=Access.READ_PRE_OP), 0x1009, 0, access=Access(0)
        ),
    )
    with cat.MainDevice(Segment.from_clone(tmp_path / "line")) as main:
        sub = main.scan()[1]
        assert sub.sdo.read(0x2102) == bytes(2)
        assert sub.sdo.read(0x1009) == b"1"
        sub.request_state("SAFE_OP")
        assert sub.sdo.read(0x1009) == b"1"
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.read(0x2102)
        assert caught.value.code == 0x0800_0022


def test_a_device_behind_a_port_that_its_parent_does_not_have(tmp_path: Path) -> None:
    cat.clone(Segment([Coupler(), Servo(serial=1)]), tmp_path / "first", pre_op=True)
    folder = edited(
        tmp_path / "first", tmp_path / "line", lambda device: replace(device, parent_port=2)
    )
    with pytest.raises(ConfigurationError, match="device 0 has no port 2") as caught:
        Segment.from_clone(folder)
    assert "clone the segment again" in caught.value.hint
