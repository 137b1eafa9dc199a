"""PySOEM, unmodified, reads and writes the files of a virtual device, and updates its firmware.

PySOEM and our client use the same device, so that each judges the other through it.
"""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import catenary as cat
from catenary.link import Recorder
from catenary.types import VISIBLE_STRING
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    DeviceFiles,
    DeviceFirmware,
    Segment,
    make_firmware,
)
from tests.peers.conftest import serving
from tests.peers.test_pysoem import again, find, opened

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

TERMINAL, DEVICES = 1, 2
BOOTSTRAP_WORDS = 0x14, 0x16  # in the SII
REFUSED = -5  # EC_ERR_TYPE_FOE_ERROR of SOEM
ROOM = 128 - 12
PASSWORD = 0x1234
FOE_TIMEOUT_US = 1_000_000
IMAGE = make_firmware(0x0004_0002, "2.0", size=10_000)
LINE = """
[[device]]
kind = "coupler"

[[device]]
kind = "analog_inputs"

[device.files]
contents = { "log.txt" = "started" }
password = 0x1234
bootstrap_bytes = 256
firmware = { name = "app.efw", version = "1.2" }
"""


@pytest.fixture
def veth_ends(veth: tuple[str, str], tmp_path: Path) -> Iterator[str]:
    ours, theirs = veth
    file = tmp_path / "files.toml"
    file.write_text(LINE)
    with serving(theirs, file):
        yield ours


@pytest.fixture
def master(veth_ends: str) -> Iterator[Any]:
    with opened(DEVICES, veth_ends) as master:
        yield master


def content(size: int) -> bytes:
    return bytes(k * 7 & 0xFF for k in range(size))


def write(slave: Any, name: str, data: bytes, password: int = PASSWORD) -> int:
    return int(slave.foe_write(name, password, data, FOE_TIMEOUT_US))


def read(slave: Any, name: str, size: int = 20_000) -> bytes:
    return bytes(slave.foe_read(name, PASSWORD, size, FOE_TIMEOUT_US))


@again(DEVICES)
def test_pysoem_reads_and_writes_files_of_all_sizes(master: Any) -> None:
    slave = in_pre_op(master)
    assert read(slave, "log.txt") == b"started"
    for size in (1, ROOM - 1, ROOM, ROOM + 1, 4 * ROOM, 5000):
        assert write(slave, "a", content(size)) > 0
        assert read(slave, "a") == content(size)


@again(DEVICES)
def test_pysoem_reports_the_errors_of_the_device(master: Any) -> None:
    slave = in_pre_op(master)
    assert write(slave, "a", b"x", password=5) == REFUSED
    assert write(slave, "app.efw", IMAGE) == REFUSED  # accepted only in BOOT


@again(DEVICES)
def test_pysoem_updates_the_firmware(master: Any) -> None:
    slave = in_pre_op(master)
    assert slave.sdo_read(0x100A, 0) == b"1.2"
    set_state(slave, pysoem.INIT_STATE)
    receive, send = (struct.unpack("<HH", slave.eeprom_read(word)) for word in BOOTSTRAP_WORDS)
    slave.amend_mbx("out", *receive)
    slave.amend_mbx("in", *send)
    set_state(slave, pysoem.BOOT_STATE)
    assert write(slave, "app.efw", IMAGE) > 0
    set_state(slave, pysoem.INIT_STATE)
    find(master, DEVICES)
    assert in_pre_op(master).sdo_read(0x100A, 0) == b"2.0"


def in_pre_op(master: Any) -> Any:
    """Return the terminal. SOEM requests PRE-OP without waiting for it."""
    assert master.state_check(pysoem.PREOP_STATE, 3_000_000) == pysoem.PREOP_STATE
    return master.slaves[TERMINAL]


def set_state(slave: Any, state: int) -> None:
    slave.state = state
    slave.write_state()
    assert slave.state_check(state, 3_000_000) == state


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record our transfers: files of several packets, refusals, BUSY, and a firmware update."""
    path = tmp_path_factory.mktemp("foe") / "foe.pcapng"
    contents, firmware = {"log.txt": content(400)}, DeviceFirmware()
    files = DeviceFiles(contents=contents, busy=1, bootstrap_bytes=256, firmware=firmware)
    segment = Segment([Coupler(), AnalogInputs(files=files)])
    with Recorder(segment, path) as link, cat.MainDevice(link) as main:
        sub = main.scan()[TERMINAL]
        sub.foe.read("log.txt")
        sub.foe.write("new", content(3 * ROOM))
        with pytest.raises(cat.errors.FoeError):
            sub.foe.read("missing")
        with sub.boot() as foe:
            foe.write("app.efw", IMAGE)
        assert sub.sdo.read(0x100A, type=VISIBLE_STRING) == "2.0"
    assert link.dropped == 0
    return path


def test_tshark_finds_no_fault_in_our_transfers(tshark: str, recording: Path) -> None:
    bad = "_ws.malformed || _ws.expert.severity >= 0x600000 || ecat_mailbox.foe.invalid"
    assert dissect(tshark, recording, "-Y", bad) == []


def test_tshark_reads_the_names_and_the_packets(tshark: str, recording: Path) -> None:
    names = dissect(tshark, recording, "-T", "fields", "-e", "ecat_mailbox.foe_filename")
    assert [name for name in dict.fromkeys(names) if name] == [
        *("log.txt", "new", "missing", "app.efw")
    ]
    packets = dissect(tshark, recording, "-T", "fields", "-e", "ecat_mailbox.foe_packetno")
    assert max(int(packet) for packet in packets if packet) == len(IMAGE) // (256 - 12) + 1
    errors = dissect(tshark, recording, "-T", "fields", "-e", "ecat_mailbox.foe_errcode")
    assert {error for error in errors if error} == {str(0x8001)}


def dissect(tshark: str, path: Path, *options: str) -> list[str]:
    command = [tshark, "-r", str(path), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
