"""No frame hangs a segment or causes undefined behaviour in its controllers."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Crystal,
    DigitalOutputs,
    Segment,
    Servo,
    ServoQuirks,
)
from catenary.wire.datagram import EcatCommand
from tests.virtual.clocks import ACTIVATION, OFFSET, START_TIME, SYNC0_CYCLE
from tests.virtual.hostile import compile_frames, send_frames
from tests.virtual.main_device import STATION, MainDevice

MS = 1_000_000
FRAMES, SEEDS, SECONDS = 100_000, (1, 2, 3), 120.0
EDGES = (0, 1, 1000, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 3 * 2**61, 2**63 - 1, 2**63, 2**64 - 1)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_frames(tmp_path_factory.mktemp("hostile"))


@pytest.mark.parametrize("seed", SEEDS)
def test_random_frames_under_sanitizers(program: Path, seed: int) -> None:
    """`tools/sanitize frames` sends more."""
    result = send_frames(program, FRAMES, seed, SECONDS)
    assert result.returncode == 0, result.stderr
    assert f"of {FRAMES} frames" in result.stdout


def line() -> MainDevice:
    main = MainDevice(
        Segment(
            [
                Coupler(crystal=Crystal(ppm=80, jitter=20e-9)),
                Servo(),
                Servo(clock_bits=32),
                AnalogInputs(),
                DigitalOutputs(dc=True),
            ]
        )
    )
    main.number_stations()
    return main


@pytest.mark.parametrize("start", EDGES)
@pytest.mark.parametrize("offset", EDGES)
def test_clocks_continue_at_the_limits_of_their_range(offset: int, start: int) -> None:
    main = line()
    for address, form, value in (
        (OFFSET, "<Q", offset),
        (START_TIME, "<Q", start),
        (SYNC0_CYCLE, "<I", 1 * MS),
        (ACTIVATION, "<B", 3),
    ):
        main.exchange(EcatCommand.BWR, 0, address, struct.pack(form, value))
    main.let_pass(20)
    assert main.exchange(EcatCommand.BRD, 0, 0, b"\0").working_counter == 5


@pytest.mark.parametrize("ahead", [10 * MS, 2**63 - 1])
def test_pulses_continue_when_the_system_time_wraps(ahead: int) -> None:
    """The start time is beyond 2^63."""
    main = line()
    [now] = struct.unpack("<Q", main.read(STATION, 0x0910, 8))
    main.write(STATION, OFFSET, struct.pack("<Q", 2**63 - 5 * MS - now))
    main.write(STATION, START_TIME, struct.pack("<Q", (2**63 - 5 * MS + ahead) % 2**64))
    main.write(STATION, SYNC0_CYCLE, struct.pack("<I", MS))
    main.write(STATION, ACTIVATION, b"\x03")
    main.let_pass(15.5)
    assert (main.segment.core.pulses(0)[0] > 0) is (ahead == 10 * MS)


WRITES = st.lists(
    st.tuples(
        st.sampled_from([0x0010, 0x0120, 0x0400, 0x0500, 0x0502, 0x0600, 0x0800, 0x0808,
                         0x0810, 0x0818, 0x0900, 0x0910, 0x0920, 0x0980, 0x0990, 0x09A0, 0x1000,
                         0x1080, 0x1100]),
        st.one_of(
            st.binary(min_size=1, max_size=16),
            st.sampled_from(EDGES).map(lambda value: struct.pack("<Q", value)),
            st.sampled_from([bytes([state]) for state in (1, 2, 4, 8, 0x11, 0x12, 0x14, 0x18)]),
        ),
    ),
    max_size=12,
)  # fmt: skip


@settings(max_examples=60)
@given(writes=WRITES, mailbox=st.binary(max_size=128))
def test_random_writes_cause_no_exception(
    writes: Sequence[tuple[int, bytes]], mailbox: bytes
) -> None:
    """The link would raise an exception of an application.

    Loop control is excluded, because it can disconnect devices.
    """
    main = line()
    for position in (1, 2):
        main.start_servo(STATION + position, 64 * position)
    main.write(STATION + 1, 0x1000, mailbox.ljust(128, b"\0"))
    for address, data in writes:
        main.exchange(EcatCommand.BWR, 0, address, data)
        main.let_pass(1.3)
    main.let_pass(30)


def test_sync0_cycle_changed_after_the_check_is_ignored() -> None:
    """A frame arrives between the request for SAFE-OP and its answer. The checked value applies."""
    main = line()
    main.map_servo(STATION + 1, 0)
    main.write(STATION + 1, START_TIME, struct.pack("<Q", 2**62))
    main.write(STATION + 1, SYNC0_CYCLE, struct.pack("<I", MS))
    main.write(STATION + 1, ACTIVATION, b"\x03")
    main.write(STATION + 1, 0x0120, b"\x04\x00")
    main.let_pass(0.5)
    main.write(STATION + 1, SYNC0_CYCLE, bytes(4))
    main.let_pass(3)
    assert main.al_status(STATION + 1) == (4, 0)


def test_sync1_cycle_beyond_32_bits_is_refused() -> None:
    """SYNC1 occurs with the first SYNC0 after its time: up to 2^32 ns and one cycle later."""
    main = MainDevice(Segment([Servo(quirks=ServoQuirks(sync_signal="sync1"))]))
    main.number_stations()
    main.map_servo(STATION, 0)
    main.write(STATION, START_TIME, struct.pack("<Q", 2**62))
    main.write(STATION, SYNC0_CYCLE, struct.pack("<II", MS, 2**32 - 1))
    main.write(STATION, ACTIVATION, b"\x07")
    assert main.request(STATION, 4) == (2 | 0x10, 0x0030)


def test_too_many_mapped_objects_are_refused() -> None:
    """16 PDOs of 32 objects fit into the dictionary, but exceed the limit of the device."""
    main = MainDevice(Segment([Servo(axes=8)]))
    main.number_stations()
    main.start_mailbox(STATION)
    pdos = [0x1600 + 0x10 * axis + k for axis in range(8) for k in range(2)]
    assert main.download(STATION, 0x1C12, 0, b"\0") == 0
    for pdo in pdos:
        assert main.download(STATION, pdo, 0, b"\0") == 0
        for place in range(1, 33):
            entry = struct.pack("<I", 0x6060_0008 + 0x0800_0000 * (pdos.index(pdo) // 2))
            assert main.download(STATION, pdo, place, entry) == 0
        assert main.download(STATION, pdo, 0, b"\x20") == 0
    for place, pdo in enumerate(pdos, 1):
        assert main.download(STATION, 0x1C12, place, struct.pack("<H", pdo)) == 0
    assert main.download(STATION, 0x1C12, 0, bytes([len(pdos)])) == 0
    main.sync_manager(STATION, 2, 0x1100, 512, 0x64)
    assert main.request(STATION, 4) == (2 | 0x10, 0x001D)
