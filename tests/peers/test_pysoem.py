"""PySOEM, unmodified, tests the virtual segment over a pair of network interfaces."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import statistics
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import pytest

from catenary.realtime import private_network
from catenary.realtime.child import Child, start_python
from catenary.virtual import read_segment
from catenary.virtual.description import VENDOR_ID, Description
from catenary.virtual.devices.application import BLOB_BYTES
from tests.peers.conftest import serving
from tests.peers.soem import MAX_BUF

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

SERVO = struct.Struct("<Hbiih")  # both ways: word, mode, velocity, position, torque
SHOULDER, ELBOW = 2, 3
CYCLES = 1000
SYNC0_NS = 2_000_000
CLOCKED = """
[[device]]
kind = "coupler"

[[device]]
kind = "digital_outputs"
bits = 8

[[device]]
kind = "servo"
crystal = { ppm = 20.0, jitter = 20e-9 }
sync_missed_limit = 1000

[[device]]
kind = "servo"
crystal = { ppm = -15.0, drift_ppm = 1.0 }
sync_missed_limit = 1000
"""
OBJECT_DOES_NOT_EXIST = 0x06020000
T = TypeVar("T")
P = ParamSpec("P")
ENABLING = {0x40: 0x06, 0x21: 0x07, 0x23: 0x0F, 0x27: 0x0F}
STALLED = (pysoem.WkcError, pysoem.PacketError, pysoem.MailboxError, pysoem.SdoError)
"""Errors of PySOEM for a missing or late answer, which a busy machine causes."""


def again(devices: int, count: int = 5) -> Callable[[Callable[P, None]], Callable[P, None]]:
    """Repeat a test if this machine stalled: SOEM waits 2 ms for a frame, then reads zeros."""

    def wrapped(test: Callable[P, None]) -> Callable[P, None]:
        @functools.wraps(test)
        def repeated(*args: P.args, **named: P.kwargs) -> None:
            for _ in range(count - 1):
                with contextlib.suppress(AssertionError, *STALLED):
                    return test(*args, **named)
                find(next(iter(named.values())), devices)
            return test(*args, **named)

        return repeated

    return wrapped


@pytest.fixture
def devices(line: Path) -> list[Description]:
    return [device.description() for device in read_segment(line)]


@pytest.fixture
def master(served: str) -> Iterator[Any]:
    with opened(6, served) as master:
        yield master


@pytest.fixture
def clocked(veth: tuple[str, str], tmp_path: Path) -> Iterator[Any]:
    """Yield servos with different crystals that tolerate a stalled machine."""
    ours, theirs = veth
    file = tmp_path / "clocked.toml"
    file.write_text(CLOCKED)
    with serving(theirs, file), opened(4, ours) as master:
        yield master


@again(devices=6)
def test_finds_every_device(master: Any, devices: list[Description]) -> None:
    found = [(slave.man, slave.id, slave.rev) for slave in master.slaves]
    assert found == [(VENDOR_ID, d.product_code, d.revision) for d in devices]
    # SOEM reads only the name of the first device of a kind, and copies it.
    names = {slave.id: slave.name for slave in master.slaves}
    assert names == {d.product_code: d.name for d in reversed(devices)}


def test_reads_the_sii(master: Any, devices: list[Description]) -> None:
    """Words 0x08 to 0x0F: vendor, product, revision, serial (ETG.1000.6 table 16)."""
    for slave, d in zip(master.slaves, devices, strict=True):
        expected = struct.pack("<4I", VENDOR_ID, d.product_code, d.revision, d.serial)
        assert expected in tries(
            lambda slave=slave: b"".join(slave.eeprom_read(word) for word in range(0x08, 0x10, 2))
        )


def test_sdo_expedited(master: Any) -> None:
    servo = master.slaves[SHOULDER]
    asked = struct.pack("<I", 5000)
    assert struct.pack("<I", servo.man) in tries(lambda: servo.sdo_read(0x1018, 1))
    assert None in tries(lambda: servo.sdo_write(0x6065, 0, asked))
    assert asked in tries(lambda: servo.sdo_read(0x6065, 0))


def test_sdo_normal(master: Any) -> None:
    """The object has more than four bytes and fits in one mailbox."""
    servo = master.slaves[SHOULDER]
    assert b"shoulder" in tries(lambda: servo.sdo_read(0x1008, 0).rstrip(b"\0"))


def test_sdo_segmented(master: Any) -> None:
    """The object does not fit in one mailbox."""
    servo = master.slaves[SHOULDER]
    stored = bytes(k * 7 & 0xFF for k in range(BLOB_BYTES))
    assert stored in tries(lambda: servo.sdo_read(0x2100, 0, 4096))
    written = bytes(range(256)) * (BLOB_BYTES // 256)
    assert None in tries(lambda: servo.sdo_write(0x2101, 0, written))
    assert written in tries(lambda: servo.sdo_read(0x2101, 0, 4096))


def test_sdo_abort(master: Any) -> None:
    def code() -> int:
        with pytest.raises(pysoem.SdoError) as caught:
            master.slaves[SHOULDER].sdo_read(0x5FFF, 0)
        return int(caught.value.abort_code)

    assert OBJECT_DOES_NOT_EXIST in tries(code)


def test_a_thousand_cycles_with_the_expected_counter(master: Any) -> None:
    to_operational(master)

    def counters() -> set[int]:
        found = {exchange(master) for _ in range(CYCLES)}
        if found != {master.expected_wkc}:
            to_operational(master)
        return found

    assert {master.expected_wkc} in tries(counters)


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


def test_a_stalled_segment_leaves_no_old_answers(veth: tuple[str, str], line: Path) -> None:
    """SOEM finds answers by index modulo 16, in a socket that it does not drain."""
    ours, theirs = veth
    with serving(theirs, line, max_age=0.002) as server, opened(6, ours) as master:
        try:
            to_operational(master)
            server.process.send_signal(signal.SIGSTOP)
            for _ in range(100):
                exchange(master, 2_000)
            server.process.send_signal(signal.SIGCONT)
            cycle_until(master, lambda: exchange(master, 2_000) == master.expected_wkc)
            request_operational(master)
            lags = [cycles_to(master, word) for word in [0x06, 0x00] * 3]
            assert statistics.median_high(lags) < MAX_BUF // 2
        finally:
            server.process.send_signal(signal.SIGCONT)


WITHOUT_LRW = """
[[device]]
kind = "coupler"

[[device]]
kind = "servo"

[[device]]
kind = "servo"
lrw = false

[[device]]
kind = "servo"
mailbox_bytes = 256
"""


@pytest.fixture
def without_lrw(veth: tuple[str, str], tmp_path: Path) -> Iterator[Any]:
    """Yield three servos with three SIIs; one supports only LRD and LWR."""
    ours, theirs = veth
    file = tmp_path / "without_lrw.toml"
    file.write_text(WITHOUT_LRW)
    with serving(theirs, file), opened(4, ours) as master:
        yield master


@again(devices=4)
def test_servos_with_three_siis_reach_op_with_the_right_counter(without_lrw: Any) -> None:
    master = without_lrw
    to_operational(master)
    assert master.expected_wkc == 9
    cycle_until(master, lambda: exchange(master) == 9)


@pytest.fixture
def ring(line: Path, veth: tuple[str, str]) -> Iterator[tuple[str, str, Child]]:
    """Yield both interfaces of a ring, and the serving process (see serve_ring.py)."""
    script = str(Path(__file__).parent / "serve_ring.py")
    with private_network.veth_pair() as other:
        command = [script, str(line), veth[1], other[1], str(SHOULDER), str(ELBOW)]
        with start_python(command) as server:
            assert server.read_line(20.0) == "ready"
            yield veth[0], other[0], server


def test_a_ring_with_two_interfaces_survives_a_cut(ring: tuple[str, str, Child]) -> None:
    """Test the cable redundancy of SOEM with a cut during cyclic operation, and a repair."""
    first, second, server = ring
    with opened(6, first, second) as master:
        to_operational(master)
        expected = master.expected_wkc
        for number, word in ((None, "whole"), (signal.SIGUSR1, "cut"), (signal.SIGUSR2, "join")):
            if number is not None:
                os.kill(server.pid, number)
                assert server.read_line(20.0) == word
                cycle_until(master, lambda: exchange(master) == expected)
            counters = [exchange(master, 5_000_000) for _ in range(100)]
            assert counters == [expected] * 100, word


@contextlib.contextmanager
def opened(devices: int, *interfaces: str) -> Iterator[Any]:
    """Yield a master with its devices, and bring them to INIT at the end."""
    master = pysoem.Master()
    master.open(*interfaces)
    try:
        find(master, devices)
        yield master
    finally:
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.close()


def tries(ask: Callable[[], T], count: int = 10) -> Iterator[T | None]:
    """Yield the results of repeated calls.

    SOEM waits 2 ms for a frame, three times. If this machine stalls for longer, an answer is
    missing, and may arrive for the next call.
    """
    for number in range(count):
        try:
            yield ask()
        except (*STALLED, pytest.fail.Exception):
            if number == count - 1:
                raise


def find(master: Any, devices: int, seconds: float = 20.0) -> None:
    """Find all devices. SOEM waits 2 ms for an answer, three times; a busy machine needs more."""
    deadline = time.monotonic() + seconds
    while master.config_init() != devices:
        assert time.monotonic() < deadline


def to_operational(master: Any) -> None:
    master.config_map()
    assert master.state_check(pysoem.SAFEOP_STATE, 2_000_000) == pysoem.SAFEOP_STATE
    request_operational(master)


def request_operational(master: Any) -> None:
    master.state = pysoem.OP_STATE
    master.write_state()

    def operational() -> bool:
        if master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE:
            return True
        master.read_state()
        if any(slave.state & pysoem.STATE_ACK for slave in master.slaves):
            # the segment or this machine stalled for longer than a watchdog
            master.state = pysoem.OP_STATE | pysoem.STATE_ACK
            master.write_state()
        return False

    cycle_until(master, operational)


def cycles_to(master: Any, controlword: int) -> int:
    """Return how many exchanges after the controlword the statusword follows it."""
    servo, wanted = master.slaves[SHOULDER], {0x06: 0x21, 0x00: 0x40}[controlword]
    for _ in range(400):  # earlier answers have been received
        exchange(master, 2_000)
    servo.output = SERVO.pack(controlword, 8, 0, 0, 0)
    for count in range(1000):
        exchange(master, 2_000)
        time.sleep(0.001)  # real time, over a real wire: the servo steps every 0.25 ms
        if SERVO.unpack(servo.input)[0] & 0x6F == wanted:
            return count
    raise AssertionError(f"no 0x{wanted:02X} after controlword 0x{controlword:02X}")


def cycle_until(master: Any, done: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline
        exchange(master)


def exchange(master: Any, timeout_us: int = 200_000) -> int:
    master.send_processdata()
    return int(master.receive_processdata(timeout_us))


@again(devices=4)
def test_clocks_and_sync_pulses_up_to_op(clocked: Any) -> None:
    """The order is that of SOEM's maintainer (SOEM#487): clocks, SYNC0, mapping."""
    master = clocked
    assert master.config_dc()
    for servo in servos(master):
        servo.dc_sync(True, SYNC0_NS)
    to_operational(master)
    for servo in servos(master):
        assert struct.pack("<H", 2) in tries(lambda servo=servo: servo.sdo_read(0x1C32, 1))
        assert struct.pack("<I", SYNC0_NS) in tries(lambda servo=servo: servo.sdo_read(0x1C32, 2))

    def together() -> bool:
        return all(abs(difference_ns(servo)) < 1_000 for servo in servos(master))

    cycle_until(master, together, 60.0)
    before = [next_pulse_ns(servo) for servo in servos(master)]
    cycle_until(master, lambda: next_pulse_ns(servos(master)[-1]) > before[-1])
    # With a common time, they pulse at the same times of it, for any crystals.
    assert {instant % SYNC0_NS for instant in before} == {0}


@again(devices=4)
def test_a_sync0_cycle_too_short_for_the_servo_is_refused(clocked: Any) -> None:
    master = clocked
    assert master.config_dc()
    servo = master.slaves[SHOULDER]
    servo.dc_sync(True, 20_000)
    master.config_map()
    assert master.state_check(pysoem.SAFEOP_STATE, 500_000) != pysoem.SAFEOP_STATE
    master.read_state()
    assert (servo.state, servo.al_status) == (0x12, 0x0036)  # DC SYNC0 cycle time


def servos(master: Any) -> list[Any]:
    return [master.slaves[position] for position in (SHOULDER, ELBOW)]


def register(slave: Any, address: int, size: int) -> bytes:
    return bytes(next(tries(lambda: slave._fprd(address, size), 1000)) or b"")


def difference_ns(slave: Any) -> int:
    """Return register 0x092C, which has sign and magnitude."""
    [raw] = struct.unpack("<I", register(slave, 0x092C, 4))
    return -(raw & 0x7FFF_FFFF) if raw >> 31 else int(raw)


def next_pulse_ns(slave: Any) -> int:
    [instant] = struct.unpack("<Q", register(slave, 0x0990, 8))
    return int(instant)
