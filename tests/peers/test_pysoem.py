"""A foreign MainDevice judges the virtual segment: PySOEM, unmodified, over a pair of network
interfaces."""

from __future__ import annotations

import os
import signal
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from catenary.realtime import private_network
from catenary.realtime.child import Child, start_python
from catenary.virtual import Segment
from catenary.virtual.description import VENDOR_ID, Description
from catenary.virtual.devices.application import BLOB_BYTES

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

SERVO = struct.Struct("<Hbiih")  # both ways: word, mode, velocity, position, torque
SHOULDER, ELBOW = 2, 3
CYCLES = 1000
OBJECT_DOES_NOT_EXIST = 0x06020000
ENABLING = {0x40: 0x06, 0x21: 0x07, 0x23: 0x0F, 0x27: 0x0F}


@pytest.fixture
def devices(line: Path) -> list[Description]:
    return [device.description() for device in Segment.from_toml(line)]


@pytest.fixture
def master(served: str) -> Iterator[Any]:
    master = pysoem.Master()
    master.open(served)
    try:
        assert master.config_init() == 6
        yield master
    finally:
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.close()


def test_finds_every_device(master: Any, devices: list[Description]) -> None:
    found = [(slave.man, slave.id, slave.rev) for slave in master.slaves]
    assert found == [(VENDOR_ID, d.product_code, d.revision) for d in devices]
    # SOEM reads the name of the first of a kind only, and copies it to the others.
    names = {slave.id: slave.name for slave in master.slaves}
    assert names == {d.product_code: d.name for d in reversed(devices)}


def test_reads_the_sii(master: Any, devices: list[Description]) -> None:
    """Words 0x08 to 0x0F: vendor, product, revision, serial (ETG.1000.6 table 16)."""
    for slave, d in zip(master.slaves, devices, strict=True):
        words = b"".join(slave.eeprom_read(address) for address in (0x08, 0x0A, 0x0C, 0x0E))
        assert struct.unpack("<4I", words) == (VENDOR_ID, d.product_code, d.revision, d.serial)


def test_sdo_expedited(master: Any) -> None:
    servo = master.slaves[SHOULDER]
    assert struct.unpack("<I", servo.sdo_read(0x1018, 1)) == (servo.man,)
    servo.sdo_write(0x6065, 0, struct.pack("<I", 5000))
    assert servo.sdo_read(0x6065, 0) == struct.pack("<I", 5000)


def test_sdo_normal(master: Any) -> None:
    """More than four bytes, in one mailbox."""
    servo = master.slaves[SHOULDER]
    assert servo.sdo_read(0x1008, 0).rstrip(b"\0") == b"shoulder"


def test_sdo_segmented(master: Any) -> None:
    """More than one mailbox holds."""
    servo = master.slaves[SHOULDER]
    assert servo.sdo_read(0x2100, 0, 4096) == bytes(k * 7 & 0xFF for k in range(BLOB_BYTES))
    written = bytes(range(256)) * (BLOB_BYTES // 256)
    servo.sdo_write(0x2101, 0, written)
    assert servo.sdo_read(0x2101, 0, 4096) == written


def test_sdo_abort(master: Any) -> None:
    with pytest.raises(pysoem.SdoError) as caught:
        master.slaves[SHOULDER].sdo_read(0x5FFF, 0)
    assert caught.value.abort_code == OBJECT_DOES_NOT_EXIST


def test_a_thousand_cycles_with_the_expected_counter(master: Any) -> None:
    to_operational(master)
    counters = [exchange(master) for _ in range(CYCLES)]
    assert counters == [master.expected_wkc] * CYCLES


def test_a_servo_goes_through_its_states_to_a_position(master: Any) -> None:
    to_operational(master)
    servo = master.slaves[ELBOW]
    seen: list[int] = []

    def enabled() -> bool:
        status, _, _, position, _ = SERVO.unpack(servo.input)
        state = status & 0x6F if status & 0x6F in ENABLING else status & 0x4F
        if state not in seen:
            seen.append(state)
        servo.output = SERVO.pack(ENABLING[state], 8, 0, position, 0)
        return state == 0x27

    cycle_until(master, enabled)
    assert seen == [0x40, 0x21, 0x23, 0x27]  # disabled, ready, switched on, operation enabled

    _, _, _, start, _ = SERVO.unpack(servo.input)
    path = iter(range(start, start + 100_001, 500))

    def arrived() -> bool:
        servo.output = SERVO.pack(0x0F, 8, 0, next(path, start + 100_000), 0)
        return abs(SERVO.unpack(servo.input)[3] - start - 100_000) <= 100

    cycle_until(master, arrived)


@pytest.fixture
def ring(line: Path, veth: tuple[str, str]) -> Iterator[tuple[str, str, Child]]:
    """Both interfaces of a ring, and who serves it (serve_ring.py says what it obeys)."""
    script = str(Path(__file__).parent / "serve_ring.py")
    with private_network.veth_pair() as other:
        command = [script, str(line), veth[1], other[1], str(SHOULDER), str(ELBOW)]
        with start_python(command) as server:
            assert server.read_line(20.0) == "ready"
            yield veth[0], other[0], server


def test_a_ring_over_both_interfaces_survives_a_cut(ring: tuple[str, str, Child]) -> None:
    """Cable redundancy of SOEM: a cut in the middle of cyclic operation, and joined again."""
    first, second, server = ring
    master = pysoem.Master()
    master.open(first, second)
    try:
        assert master.config_init() == 6
        to_operational(master)
        expected = master.expected_wkc
        for number, word in ((None, "whole"), (signal.SIGUSR1, "cut"), (signal.SIGUSR2, "join")):
            if number is not None:
                os.kill(server.pid, number)
                assert server.read_line(20.0) == word
                cycle_until(master, lambda: exchange(master) == expected)
            counters = [exchange(master, 5_000_000) for _ in range(100)]
            assert counters == [expected] * 100, word
    finally:
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.close()


def to_operational(master: Any) -> None:
    master.config_map()
    assert master.state_check(pysoem.SAFEOP_STATE, 2_000_000) == pysoem.SAFEOP_STATE
    master.state = pysoem.OP_STATE
    master.write_state()

    def operational() -> bool:
        return bool(master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE)

    cycle_until(master, operational)


def cycle_until(master: Any, done: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline
        exchange(master)


def exchange(master: Any, timeout_us: int = 200_000) -> int:
    master.send_processdata()
    return int(master.receive_processdata(timeout_us))
