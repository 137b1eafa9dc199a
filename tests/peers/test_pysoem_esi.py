"""PySOEM, unmodified, brings virtual devices from real ESI files to OP with their defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.peers.conftest import serving
from tests.peers.test_pysoem import again, opened, to_operational
from tests.virtual.test_esi_files import DEVICES

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

SEGMENT = """
[[device]]
kind = "esi"
esi = "{path}"
device = "{name}"
serial = 5
"""


@pytest.mark.parametrize(("file", "name", "outputs", "inputs"), DEVICES)
def test_the_default_configuration_reaches_op(
    shared_data: Path,
    veth: tuple[str, str],
    tmp_path: Path,
    file: str,
    name: str,
    outputs: int,
    inputs: int,
) -> None:
    ours, theirs = veth
    segment = tmp_path / "segment.toml"
    segment.write_text(SEGMENT.format(path=shared_data / "esi" / file, name=name))
    with serving(theirs, segment), opened(1, ours) as master:
        reach_op(master=master)
        [slave] = master.slaves
        assert (len(slave.output), len(slave.input)) == (outputs, inputs)


@again(devices=1)
def reach_op(master: Any) -> None:
    to_operational(master)
    master.read_state()
    assert [slave.state for slave in master.slaves] == [pysoem.OP_STATE]
