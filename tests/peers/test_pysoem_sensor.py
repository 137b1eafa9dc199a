"""PySOEM, unmodified, reads sensors of a plant's model."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from catenary.virtual.description import VENDOR_ID
from tests.peers.conftest import serving
from tests.peers.test_pysoem import again, cycle_until, opened, to_operational, tries
from tests.virtual.bodies import ON_THE_FLOOR
from tests.virtual.plants import GRAVITY

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")
pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra `sim`)")

SEGMENT = """
[plant]
model = "box.xml"
keyframe = "turned"
held = "trunk"

[[device]]
kind = "servo"

[[device]]
kind = "model_sensor"
name = "IMU"
serial = 7
sensors = ["orientation", "gyro", "acceleration"]
"""
VALUES = struct.Struct("<10f")


@pytest.fixture
def imu(veth: tuple[str, str], tmp_path: Path) -> Iterator[Any]:
    ours, theirs = veth
    (tmp_path / "box.xml").write_text(ON_THE_FLOOR)
    file = tmp_path / "box.toml"
    file.write_text(SEGMENT)
    with serving(theirs, file), opened(2, ours) as master:
        yield master


@again(devices=2)
def test_sii_and_objects(imu: Any) -> None:
    slave = imu.slaves[1]
    assert (slave.man, slave.name) == (VENDOR_ID, "IMU")
    assert b"IMU" in tries(lambda: slave.sdo_read(0x1008, 0).rstrip(b"\0"))
    assert b"\x04" in tries(lambda: slave.sdo_read(0x6000, 0))


@again(devices=2)
def test_values_in_op(imu: Any) -> None:
    to_operational(imu)
    imu.read_state()
    assert [slave.state for slave in imu.slaves] == [pysoem.OP_STATE] * 2
    slave = imu.slaves[1]
    assert (len(slave.output), len(slave.input)) == (0, VALUES.size)

    def rests() -> bool:
        values = VALUES.unpack(slave.input)
        expected = [0.5**0.5, 0, 0, 0.5**0.5, 0, 0, 0, 0, 0, GRAVITY]
        return list(values) == pytest.approx(expected, abs=0.02)

    cycle_until(imu, rests)
