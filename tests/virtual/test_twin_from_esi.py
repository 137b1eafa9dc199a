"""Twins from ESIs: selection of the device, rules, and axes that move."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.virtual import Device, Motor, Segment, TwinOptions, faults
from tests.virtual.test_esi_files import DEVICES

OP = 8
CIA402 = "hpm_ECAT_CIA402.xml"


@pytest.mark.parametrize(("file", "name", "outputs", "inputs"), DEVICES)
def test_every_file_becomes_a_twin(
    shared_data: Path, file: str, name: str, outputs: int, inputs: int
) -> None:
    product = int(name, 16) if name else None
    model = Device.from_esi(shared_data / "esi" / file, product=product, serial=5)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        identity = sub.identity
        assert (identity.vendor, identity.product, identity.revision) == model.esi.key
        data = cat.ProcessData(sub)
        with cat.Loop(data, period=2e-3) as loop:
            for _ in range(5):
                next(loop)
            assert model.state == OP
            assert (len(data.outputs), len(data.inputs)) == (outputs, inputs)


def test_a_revision_needs_a_product(shared_data: Path) -> None:
    with pytest.raises(ValueError, match="revision=0x1 needs product="):
        Device.from_esi(shared_data / "esi" / "bogus_servo.xml", revision=1)


def test_another_revision_is_refused(shared_data: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"bogus_servo\.xml"):
        Device.from_esi(shared_data / "esi" / "bogus_servo.xml", product=0xB0905030, revision=99)


@pytest.mark.parametrize("dc", [False, True])
def test_the_axis_of_an_esi_moves(shared_data: Path, dc: bool) -> None:
    options = TwinOptions(motor=Motor(counts_per_turn=4096), modules=("csp - axis", None))
    path = shared_data / "esi" / CIA402
    model = Device.from_esi(path, options=options)
    assert model.offsets == (0,)
    with cat.MainDevice(Segment([model])) as main:
        drives = main.scan(esi=path).drives
        arm = cat.Drives(drives, counts_per_turn=4096, velocity_limit=1.0, dc=dc)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait(arm.move_by(0.5))
            assert model.axis_position() == pytest.approx(0.5, abs=5e-3)
            assert model.core.synchronous(0)[0] is dc


def test_a_fault_reaches_the_axis_of_an_esi(shared_data: Path) -> None:
    options = TwinOptions(modules=("csp - axis", None))
    model = Device.from_esi(shared_data / "esi" / CIA402, options=options)
    segment = Segment([model])
    with cat.MainDevice(segment) as main:
        main.scan()
        segment.inject(faults.DriveFault(device=0, code=0x7300))
        main.scan()
        assert model.drive_state() == "FAULT"
        assert model.read_object(0x603F) == b"\x00\x73"


def test_a_device_without_axes_refuses_faults_of_drives(shared_data: Path) -> None:
    segment = Segment([Device.from_esi(shared_data / "esi" / "hpm_ECAT_IO.xml")])
    with pytest.raises(ValueError, match=r"device 0 \(esi\) is not a servo"):
        segment.inject(faults.DriveFault(device=0, code=0x7300))
