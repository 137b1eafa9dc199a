"""Quirks of PDO objects: refused writes, PDOs at power-up, exclusive PDOs, repeated objects."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.virtual import AnalogInputs, MappingQuirks, Segment, Servo, read_segment
from catenary.virtual.devices import Device
from catenary.virtual.sii_image import make_sii_image
from catenary.wire.sii import decode_sii
from catenary.wire.sii_categories import CoeDetails
from tests.virtual.main_device import STATION, MainDevice

PRE_OP = 2
READ_ONLY, CANNOT_BE_MAPPED, LOCAL_CONTROL = 0x0601_0002, 0x0604_0041, 0x0800_0021


def in_pre_op(device: Device) -> MainDevice:
    main = MainDevice(Segment([device]))
    main.number_stations()
    main.start_mailbox(STATION)
    main.request(STATION, PRE_OP)
    return main


def servo(**quirks: object) -> MainDevice:
    return in_pre_op(Servo(mapping_quirks=MappingQuirks(**quirks)))  # type: ignore[arg-type]


def write(main: MainDevice, index: int, subindex: int, data: bytes) -> int:
    return main.download(STATION, index, subindex, data)


@pytest.mark.parametrize("how", ["declared", "silent"])
def test_fixed_pdos_refuse_new_entries_and_keep_their_own(how: str) -> None:
    main = servo(fixed_pdos=how)
    assert write(main, 0x1C13, 0, b"\x00") == 0
    assert write(main, 0x1A00, 0, b"\x00") == READ_ONLY
    assert write(main, 0x1A00, 1, bytes(4)) == READ_ONLY
    assert main.upload(STATION, 0x1A00, 0) == b"\x05"


@pytest.mark.parametrize("how", ["declared", "silent"])
def test_fixed_lists_refuse_other_pdos(how: str) -> None:
    main = servo(fixed_lists=how)
    assert write(main, 0x1C12, 0, b"\x00") == READ_ONLY
    assert main.upload(STATION, 0x1C12, 1) == b"\x00\x16"


def test_refusal_has_the_abort_code_of_the_device() -> None:
    main = servo(fixed_lists="silent", abort_code=LOCAL_CONTROL)
    assert write(main, 0x1C12, 0, b"\x00") == LOCAL_CONTROL


def test_only_declared_fixed_pdos_are_flagged_in_the_sii() -> None:
    for how, flag in (("no", 0), ("declared", 0x10), ("silent", 0)):
        device = Servo(mapping_quirks=MappingQuirks(fixed_pdos=how))  # type: ignore[arg-type]
        sii = decode_sii(make_sii_image(device.description()))
        assert {pdo.flags for pdo in sii.receive_pdos + sii.transmit_pdos} == {flag}


def test_sii_can_deny_changes() -> None:
    device = Servo(mapping_quirks=MappingQuirks(coe_details=0x03))
    sii = decode_sii(make_sii_image(device.description()))
    assert sii.general is not None
    assert sii.general.coe == CoeDetails.SDO | CoeDetails.SDO_INFORMATION


def test_pdos_at_power_up_can_differ_from_the_sii() -> None:
    main = servo(power_up=(0x1602, 0x1A01))
    assert main.upload(STATION, 0x1C12, 1) == b"\x02\x16"
    assert main.upload(STATION, 0x1C13, 1) == b"\x01\x1a"


def test_exclusive_pdos_are_not_assigned_together() -> None:
    main = servo(exclusive=True)
    assert write(main, 0x1C13, 0, b"\x00") == 0
    assert write(main, 0x1C13, 2, b"\x01\x1a") == 0
    assert write(main, 0x1C13, 0, b"\x02") == LOCAL_CONTROL
    assert write(main, 0x1C13, 2, b"\x02\x1a") == 0
    assert write(main, 0x1C13, 0, b"\x02") == 0


def test_mappable_object_can_be_refused() -> None:
    main = servo(refused_objects=(0x60F4,))
    assert write(main, 0x1C13, 0, b"\x00") == 0
    assert write(main, 0x1A00, 0, b"\x00") == 0
    assert write(main, 0x1A00, 1, b"\x20\x00\xf4\x60") == CANNOT_BE_MAPPED


def test_object_in_two_pdos_with_different_sizes() -> None:
    main = in_pre_op(AnalogInputs(channels=1, second_pdo="twice"))
    assert main.upload(STATION, 0x1C13, 0) == b"\x02"
    assert main.upload(STATION, 0x1A10, 1) == b"\x08\x11\x00\x60"
    assert main.upload(STATION, 0x1A00, 6) == b"\x10\x11\x00\x60"


def test_quirks_are_read_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "segment.toml"
    path.write_text(
        '[[device]]\nkind = "servo"\n'
        'mapping_quirks = { fixed_pdos = "silent", power_up = [0x1601] }\n'
        '[[device]]\nkind = "analog_inputs"\nsecond_pdo = "compact"\n'
    )
    first, second = read_segment(path)
    assert isinstance(first, Servo)
    assert first.mapping_quirks == MappingQuirks(fixed_pdos="silent", power_up=(0x1601,))
    assert isinstance(second, AnalogInputs)
    assert second.second_pdo == "compact"
    path.write_text('[[device]]\nkind = "servo"\nmapping_quirks = { coe_details = 256 }\n')
    with pytest.raises(ConfigurationError, match="coe_details"):
        read_segment(path)


def test_invalid_codes_are_refused() -> None:
    with pytest.raises(ValueError, match="abort_code"):
        MappingQuirks(abort_code=1 << 32)
    with pytest.raises(ValueError, match="coe_details"):
        MappingQuirks(coe_details=0x40)
