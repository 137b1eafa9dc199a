"""PySOEM, unmodified, reads the diagnosis history of a virtual servo."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.peers.conftest import serving
from tests.peers.test_pysoem import again, opened, tries

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

SEGMENT = """
[[device]]
kind = "servo"
diagnosis = { messages = 8, message_bytes = 32 }

[[fault]]
kind = "drive_fault"
device = 0
code = 0x8611
at = 0.0
"""


@pytest.fixture
def master(veth: tuple[str, str], tmp_path: Path) -> Iterator[Any]:
    ours, theirs = veth
    file = tmp_path / "servo.toml"
    file.write_text(SEGMENT)
    with serving(theirs, file), opened(1, ours) as master:
        found = master.slaves[0].state_check(pysoem.PREOP_STATE, 5_000_000)  # its mailbox is ready
        assert found == pysoem.PREOP_STATE
        yield master


def read(master: Any, index: int, subindex: int) -> bytes:
    """Return an object, with repetitions if this machine stalls."""
    found: bytes = next(tries(lambda: master.slaves[0].sdo_read(index, subindex)))
    return found


@again(devices=1)
def test_a_message_as_in_the_table_of_etg_1020(master: Any) -> None:
    assert read(master, 0x10F3, 2) == b"\x06"
    data = read(master, 0x10F3, 6)
    code, flags, text_id, time, kind, value = struct.unpack_from("<IHHQHH", data)
    assert len(data) == 32
    assert (code, flags, text_id) == (0x8611_E800, 0x0112, 4)  # error, local time, one parameter
    assert (kind, value) == (0x0006, 0x8611)
    assert 0 < time < struct.unpack("<Q", read(master, 0x10F8, 0))[0]
    master.slaves[0].sdo_write(0x10F3, 3, b"\x06")
    assert read(master, 0x10F3, 3) == b"\x06"
    with pytest.raises(pysoem.SdoError) as caught:
        master.slaves[0].sdo_write(0x10F3, 3, b"\x05")
    assert caught.value.abort_code == 0x06090032


@again(devices=1)
def test_the_history_has_no_complete_access(master: Any) -> None:
    """As in Beckhoff's slave stack code."""
    for _ in range(5):
        with pytest.raises((pysoem.SdoError, pysoem.WkcError)) as raised:
            master.slaves[0].sdo_read(0x10F3, 0, ca=True)
        if raised.type is pysoem.SdoError:  # not a late answer on a busy machine
            return
    pytest.fail("no answer in five attempts")
