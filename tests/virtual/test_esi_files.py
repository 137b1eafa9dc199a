"""Virtual devices from real ESI files reach OP with their default configuration, by our plan."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.virtual import Segment, from_esi

OP = 8
# file, device, bytes of outputs and inputs in the default configuration
DEVICES = (
    ("bogus_io.xml", "", 1, 1),
    ("bogus_servo.xml", "0xB0905030", 0, 0),  # no PDO is assigned, and the mailbox has no size
    ("bogus_servo.xml", "0xB0905031", 0, 0),
    ("hpm_ECAT_CIA402.xml", "", 8, 8),  # the default module of its first slot
    ("hpm_ECAT_EOE.xml", "", 4, 4),
    ("hpm_ECAT_FOE.xml", "", 4, 4),
    ("hpm_ECAT_IO.xml", "", 4, 4),
    ("metalmusings_EaserCAT_2000.xml", "", 16, 34),
    ("metalmusings_EaserCAT_6000.xml", "", 1, 12),
    ("pollen_LeftElbowOrbita2d_fw1.0.xml", "", 43, 66),
    ("pollen_Orbita2d.xml", "", 43, 66),
)


@pytest.mark.parametrize(("file", "name", "outputs", "inputs"), DEVICES)
def test_the_default_configuration_reaches_op(
    shared_data: Path, file: str, name: str, outputs: int, inputs: int
) -> None:
    model = from_esi(shared_data / "esi" / file, name, serial=5)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        identity = sub.identity
        assert (identity.vendor, identity.product, identity.revision) == model.esi.key
        assert identity.serial == 5
        data = cat.ProcessData(sub)
        with cat.Loop(data, period=2e-3) as loop:
            for _ in range(5):
                next(loop)
            assert model.state == OP
            assert (len(data.outputs), len(data.inputs)) == (outputs, inputs)


@pytest.mark.parametrize(
    ("file", "mode"),
    [
        ("hpm_ECAT_CIA402.xml", "DC"),
        ("hpm_ECAT_EOE.xml", "DC"),
        ("hpm_ECAT_FOE.xml", "DC"),
        ("hpm_ECAT_IO.xml", "DC"),
        ("metalmusings_EaserCAT_2000.xml", "DC"),
        ("metalmusings_EaserCAT_6000.xml", "DC"),
    ],
)
def test_the_clock_modes_start_sync0(shared_data: Path, file: str, mode: str) -> None:
    """Pollen's files are missing: their shift of 2 s is longer than a cycle."""
    model = from_esi(shared_data / "esi" / file)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        data = cat.ProcessData(sub, dc=cat.DistributedClock(op_mode=mode))
        with cat.Loop(data, period=2e-3) as loop:
            for _ in range(5):
                next(loop)
            assert model.state == OP
            assert model.core.peek(0, 0x0981, 1) == b"\x03"
