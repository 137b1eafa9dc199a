"""PySOEM, unmodified, brings twins of real SIIs, and of a clone, to OP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import catenary as cat
from catenary.virtual import AnalogInputs, Coupler, DigitalOutputs, Segment, Servo
from catenary.wire.sii import decode_sii
from tests.peers.conftest import serving
from tests.peers.test_pysoem import again, opened, to_operational
from tests.virtual.test_twin_from_sii import IMAGES

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

SEGMENT = """
[[device]]
kind = "coupler"

[[device]]
kind = "sii"
sii = "{path}"
"""
FILES = [file for file, *_ in IMAGES]


@pytest.mark.parametrize("file", FILES)
def test_a_twin_of_an_sii_reaches_op(
    shared_data: Path, veth: tuple[str, str], tmp_path: Path, file: str
) -> None:
    ours, theirs = veth
    path = shared_data / "sii" / file
    segment = tmp_path / "segment.toml"
    segment.write_text(SEGMENT.format(path=path))
    header = decode_sii(path.read_bytes()).header
    with serving(theirs, segment), opened(2, ours) as master:
        reach_op(master=master)
        twin = master.slaves[1]
        assert (twin.man, twin.id, twin.rev) == (header.vendor, header.product, header.revision)


def test_the_twins_of_a_clone_reach_op(veth: tuple[str, str], tmp_path: Path) -> None:
    ours, theirs = veth
    devices = [Coupler(), DigitalOutputs(bits=8), Servo(serial=1), AnalogInputs()]
    cat.clone(Segment(devices), tmp_path / "line", pre_op=True)
    with serving(theirs, tmp_path / "line"), opened(4, ours) as master:
        reach_op(master=master)
        found = [(each.man, each.id, each.rev) for each in master.slaves]
        wanted = [device.whole_description() for device in devices]
        assert found == [(each.vendor, each.product_code, each.revision) for each in wanted]


@again(devices=2)
def reach_op(master: Any) -> None:
    to_operational(master)
    master.read_state()
    assert [slave.state for slave in master.slaves] == [pysoem.OP_STATE] * len(master.slaves)
