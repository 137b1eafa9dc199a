"""Twins from SIIs: every valid image of the shared data, and its rules."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, SdoAbort
from catenary.virtual import Coupler, Device, Segment, Servo, TwinOptions, faults
from catenary.virtual.mapping_quirks import MappingQuirks
from catenary.wire.sii import decode_sii

OP = 8
# file, bytes of outputs and inputs that our MainDevice exchanges by the PDOs of the SII
IMAGES = (
    ("beckhoff_ek1100.bin", 0, 0),
    ("beckhoff_el2004.bin", 1, 0),
    ("beckhoff_el2828.bin", 1, 0),
    ("beckhoff_el2889.bin", 2, 0),
    ("metalmusings_EaserCAT_2000.bin", 0, 0),  # only its dictionary lists its PDOs
    ("metalmusings_EaserCAT_6000.bin", 0, 0),
    # PDO 0x1700 is assigned to a SyncManager in mailbox mode, which carries no process data
    ("pollen_LeftElbowOrbita2d_fw1.0.bin", 43, 35),
    ("pollen_Orbita2d.bin", 43, 66),
)
EMPTY = "empty_issue286.bin"


def test_every_image_of_the_shared_data_is_here(shared_data: Path) -> None:
    present = {path.name for path in (shared_data / "sii").glob("*.bin")}
    assert present == {name for name, *_ in IMAGES} | {EMPTY}


@pytest.mark.parametrize(("file", "outputs", "inputs"), IMAGES)
def test_the_twin_is_scanned_and_reaches_op(
    shared_data: Path, file: str, outputs: int, inputs: int
) -> None:
    path = shared_data / "sii" / file
    header = decode_sii(path.read_bytes()).header
    model = Device.from_sii(path)
    with cat.MainDevice(Segment([Coupler(), model])) as main:
        sub = main.scan()[1]
        assert tuple(sub.identity) == (
            header.vendor,
            header.product,
            header.revision,
            header.serial,
        )
        if not outputs + inputs:
            sub.request_state("SAFE_OP")
            sub.request_state("OP")
            assert model.state == OP
            return
        data = cat.ProcessData(sub)
        with cat.Loop(data, period=2e-3) as loop:
            for _ in range(5):
                next(loop)
            assert model.state == OP
            assert (len(data.outputs), len(data.inputs)) == (outputs, inputs)


def test_an_output_of_a_terminal_is_an_object(shared_data: Path) -> None:
    model = Device.from_sii(shared_data / "sii" / "beckhoff_el2004.bin")
    with cat.MainDevice(Segment([model])) as main:
        data = cat.ProcessData(main.scan()[0])
        with cat.Loop(data, period=2e-3) as loop:
            data.outputs[0] = 0b1010
            for _ in range(4):
                next(loop)
            levels = [model.read_object(0x7000 + 0x10 * k, 1)[0] for k in range(4)]
            assert levels == [0, 1, 0, 1]


def test_an_image_without_an_identity_is_refused(shared_data: Path) -> None:
    with pytest.raises(ConfigurationError, match="no identity: product code 0x00000000") as caught:
        Device.from_sii(shared_data / "sii" / EMPTY)
    assert "EEPROM is empty" in caught.value.hint


@pytest.mark.parametrize("size", [0, 1, 127, 200])
def test_a_truncated_image_is_refused(size: int) -> None:
    image = Servo().sii_image()[:size]
    with pytest.raises(ConfigurationError, match=r"SII: .*bytes") as caught:
        Device.from_sii(image)
    assert "catenary sii read" in caught.value.hint


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"gone\.bin: No such file"):
        Device.from_sii(tmp_path / "gone.bin")


def test_alias_and_serial_number_can_be_set() -> None:
    model = Device.from_sii(Servo(serial=3).sii_image(), alias=12, serial=99)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        assert (sub.alias, sub.identity.serial) == (12, 99)
        assert sub.description.notes == ()  # the checksum of the image is right


@pytest.mark.parametrize(("field", "value"), [("alias", 1 << 16), ("serial", -1)])
def test_a_number_out_of_range_is_refused(field: str, value: int) -> None:
    numbers: dict[str, int] = {field: value}
    with pytest.raises(ValueError, match=f"{field} must be"):
        Device.from_sii(Servo().sii_image(), **numbers)  # type: ignore[arg-type]


def test_a_wrong_checksum_is_served_as_it_is() -> None:
    image = bytearray(Servo().sii_image())
    image[14] ^= 1
    with cat.MainDevice(Segment([Device.from_sii(bytes(image))])) as main:
        [sub] = main.passive_scan()
        assert any("checksum" in note for note in sub.description.notes)


def test_the_axis_of_an_sii_moves() -> None:
    model = Device.from_sii(Servo(serial=5).sii_image(), name="j2")
    segment = Segment([Coupler(), model])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.5))
            assert model.axis_position() == pytest.approx(0.5, abs=1e-3)
            assert model.drive_state() == "OPERATION ENABLED"


def test_two_axes_have_offsets() -> None:
    model = Device.from_sii(Servo(axes=2).sii_image())
    assert model.offsets == (0, 0x800)
    with cat.MainDevice(Segment([model])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_to([0.2, -0.3]))
            positions = [model.axis_position(axis) for axis in range(2)]
            assert positions == pytest.approx([0.2, -0.3], abs=1e-3)


def test_sync0_drives_the_axes() -> None:
    model = Device.from_sii(Servo().sii_image())
    with cat.MainDevice(Segment([model])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0, dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.2))
            active, seen, missed, *_ = model.core.synchronous(0)
            assert (active, seen, missed) == (True, True, 0)


def test_rules_that_the_image_declares_are_kept() -> None:
    """Without bit 2 of the CoE details, the assignment is read-only."""
    servo = Servo(mapping_quirks=MappingQuirks(coe_details=0x2B))
    with cat.MainDevice(Segment([Device.from_sii(servo.sii_image())])) as main:
        [sub] = main.scan()
        sub.sdo.write(0x1600, 0, b"\0")
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.write(0x1C12, 0, b"\0")
        assert caught.value.code == 0x06010002


def test_quirks_apply() -> None:
    quirks = MappingQuirks(fixed_pdos="silent", abort_code=0x0800_0021)
    model = Device.from_sii(Servo().sii_image(), options=TwinOptions(mapping_quirks=quirks))
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        with pytest.raises(SdoAbort) as caught:
            sub.sdo.write(0x1600, 0, b"\0")
        assert caught.value.code == 0x0800_0021


def test_faults_apply() -> None:
    model = Device.from_sii(Servo().sii_image())
    segment = Segment([model])
    with cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(arm, period=1e-3) as loop:
            segment.inject(faults.DriveFault(device=0, code=0x2310))
            with pytest.raises(cat.DriveError, match="0x2310"):
                loop.wait(arm.move_by(1.0))


def test_the_axes_can_be_plain_objects() -> None:
    model = Device.from_sii(Servo().sii_image(), options=TwinOptions(motor=None))
    with cat.MainDevice(Segment([model])) as main:
        main.scan()
        assert model.axes == 0
        model.write_object(0x6041, 0, struct.pack("<H", 0x1234))
        assert model.read_object(0x6041) == b"\x34\x12"
