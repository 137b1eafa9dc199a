"""States, registers, EEPROM, process data and clocks of a segment."""

from __future__ import annotations

import struct

from catenary.capture.contents import (
    AddressAssigned,
    ClockDifference,
    DeviceSilent,
    IdentityRead,
    StateReached,
    StateRefused,
    StateRequest,
    WorkingCounterBack,
    WorkingCounterDrop,
)
from catenary.capture.register_contents import (
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.wire.al import AlState
from catenary.wire.clock import encode_difference
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.fmmu import bits
from tests.capture.made import STATION, Conversation, address

INIT, PRE_OP, SAFE_OP, OP = AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP
LRW = Datagram(EcatCommand.LRW, 0x10000, bytes(4))


def request(made: Conversation, state: AlState, *, acknowledge: bool = False) -> None:
    made.write(0x0120, bytes((state | (0x10 if acknowledge else 0), 0)))


def report(made: Conversation, word: int, code: int = 0) -> None:
    made.read(0x0130, struct.pack("<HHH", word, 0, code))


def test_states_with_their_steps_and_times() -> None:
    made = Conversation()
    report(made, INIT)
    request(made, PRE_OP)
    report(made, INIT)
    report(made, PRE_OP)
    report(made, PRE_OP)
    found = [(str(event.step), event.content) for event in made.events()]
    assert found == [
        ("INIT", StateReached(INIT)),
        ("INIT→PRE", StateRequest(PRE_OP)),
        ("INIT→PRE", StateReached(PRE_OP, 2_000_000)),
    ]


def test_a_refused_state() -> None:
    made = Conversation()
    report(made, SAFE_OP)
    request(made, OP)
    report(made, SAFE_OP | 0x10, 0x001A)
    report(made, SAFE_OP | 0x10, 0x001A)
    *_, refused = made.events()
    assert refused.content == StateRefused(SAFE_OP, OP, 0x001A, SAFE_OP)
    assert str(refused.step) == "SAFE→OP"
    assert str(refused.content).startswith("OP refused in SAFE-OP: 0x001A Synchronization error")


def test_a_status_code_that_is_read_later() -> None:
    made = Conversation()
    request(made, OP)
    made.read(0x0130, b"\x14\x00")
    made.read(0x0134, b"\x1b\x00")
    assert made.contents()[-1] == StateRefused(SAFE_OP, OP, 0x001B)


def test_a_fall_from_op() -> None:
    made = Conversation()
    request(made, OP)
    report(made, OP)
    report(made, SAFE_OP | 0x10, 0x001B)
    event = made.events()[-1]
    assert str(event.step) == "OP→SAFE"
    assert str(event.content).startswith("fell from OP to SAFE-OP: 0x001B SyncManager watchdog")


def test_an_echoed_acknowledge_bit_is_no_error() -> None:
    """Controllers without a processor copy AL control, as in the captures of SOEM."""
    made = Conversation()
    request(made, INIT, acknowledge=True)
    report(made, INIT | 0x10)
    assert made.contents() == [StateRequest(INIT, acknowledge=True), StateReached(INIT, 1_000_000)]


def test_a_silent_device() -> None:
    made = Conversation()
    report(made, OP)
    made.read(0x0130, bytes(6), counter=0)
    made.read(0x0130, bytes(6), counter=0)
    report(made, OP)
    assert made.contents()[1:] == [DeviceSilent(), DeviceSilent(silent=False)]


def test_broadcasts_give_the_state_of_all_devices() -> None:
    made = Conversation()
    for position in range(2):
        assign = Datagram(EcatCommand.APWR, address(-position, 0x0010), bytes((1 + position, 0x10)))
        made.exchange(assign, answers=[(None, 1)])
    made.broadcast(EcatCommand.BWR, 0x0120, b"\x02\x00", 2)
    made.broadcast(EcatCommand.BRD, 0x0130, b"\x03\x00", 2)  # INIT and PRE-OP
    made.broadcast(EcatCommand.BRD, 0x0130, b"\x02\x00", 2)
    stream = made.stream()
    events = list(stream)
    assert [event.content for event in events][:3] == [
        AddressAssigned(0, 0x1001),
        AddressAssigned(1, 0x1002),
        StateRequest(PRE_OP),
    ]
    assert events[-1].content == StateReached(PRE_OP, 2_000_000)
    assert events[-1].device is None
    assert [device.state for device in stream.masters[0].devices] == [PRE_OP, PRE_OP]


def test_registers_of_the_next_transition() -> None:
    made = Conversation()
    report(made, PRE_OP)
    fmmu = bits(0x10000 * 8, 0x1100 * 8, 48, writes=True)
    made.write(0x0810, bytes.fromhex("0011060024000100") + bytes.fromhex("8011040020000100"))
    made.write(0x0814, b"\x64")  # a part of SyncManager 2
    made.write(0x0600, fmmu.encode())
    made.write(0x09A0, struct.pack("<II", 1_000_000, 0))
    made.write(0x0980, b"\x00\x03")
    made.write(0x0300, bytes(8))
    _, *events = made.events()
    assert [event.content for event in events] == [
        SyncManagerWrite(2, 0x1100, 6, 0x24, True),
        SyncManagerWrite(3, 0x1180, 4, 0x20, True),
        SyncManagerWrite(2, 0x1100, 6, 0x64, True),
        FmmuWrite(0, fmmu),
        RegisterWrite(0x09A0, struct.pack("<II", 1_000_000, 0)),
        SyncUnitWrite(0x0300, 1_000_000, 0, 0),
        RegisterWrite(0x0300, bytes(8)),
    ]
    assert [str(event.step) for event in events] == ["PRE→SAFE"] * 6 + ["PRE-OP"]
    assert str(events[2].content) == "SM2 0x1100 len 6 ctrl 0x64"


def test_a_write_that_no_device_processed_changes_nothing() -> None:
    made = Conversation()
    made.write(0x0810, bytes.fromhex("0011060024000100"))
    made.write(0x0814, b"\x64", counter=0)
    made.write(0x0816, b"\x00")
    contents = made.contents()
    assert contents[1] == SyncManagerWrite(2, 0x1100, 6, 0x64, True, accepted=False)
    assert contents[2] == SyncManagerWrite(2, 0x1100, 6, 0x24, False)


def read_eeprom(made: Conversation, word: int, data: bytes, status: int = 0x0040) -> None:
    made.write(0x0502, struct.pack("<HI", 0x0100, word))
    made.read(0x0502, struct.pack("<H", 0x8000 | status))  # busy
    made.read(0x0502, struct.pack("<H", status))
    made.read(0x0508, data)


def test_the_identity_from_the_eeprom() -> None:
    made = Conversation()
    read_eeprom(made, 8, struct.pack("<II", 2, 0x044C2C52))
    read_eeprom(made, 12, struct.pack("<II", 0x00120000, 7))
    assert made.contents() == [IdentityRead(2, 0x044C2C52, 0x00120000, 7)]


def test_only_valid_bytes_of_the_eeprom_count() -> None:
    """Without the flag for 8 bytes, the upper half of the data is not part of the answer."""
    made = Conversation()
    for i, number in enumerate((2, 0x044C2C52, 0x00120000)):
        read_eeprom(made, 8 + 2 * i, struct.pack("<II", number, 0xDEADBEEF), status=0)
    assert made.contents() == [IdentityRead(2, 0x044C2C52, 0x00120000)]


def cycle(made: Conversation, counter: int) -> None:
    made.exchange(LRW, answers=[(None, counter)])


def test_working_counter_drops() -> None:
    made = Conversation()
    for counter in (1, 3, 3, 2, 0, 3):
        cycle(made, counter)
    key = (EcatCommand.LRW, 0x10000, 4)
    stream = made.stream()
    assert [event.content for event in stream][1:] == [
        WorkingCounterDrop(*key, 3, 2),
        WorkingCounterBack(*key, 3, 2, 2_000_000),
    ]
    [statistics] = stream.masters[0].cycles
    assert (statistics.frames, statistics.drops, statistics.working_counters) == (6, 2, (3,))
    assert statistics.periods.mean == 1_000_000
    assert statistics.latencies.maximum == 20_000


def test_a_requested_lower_state_is_no_drop() -> None:
    made = Conversation()
    report(made, OP)
    cycle(made, 3)
    request(made, SAFE_OP)
    cycle(made, 1)
    assert not [each for each in made.contents() if isinstance(each, WorkingCounterDrop)]


def test_clock_differences_by_order_of_magnitude() -> None:
    made = Conversation()
    for difference in (2_000_000, 1_500_000, -40_000, 300, -20, 50_000):
        made.read(0x092C, struct.pack("<I", encode_difference(difference)))
    stream = made.stream()
    assert [event.content for event in stream] == [
        ClockDifference(2_000_000),
        ClockDifference(-40_000),
        ClockDifference(300),
    ]
    clock = stream.masters[0].clocks[0]
    assert (clock.reads, clock.last_ns, clock.largest_ns) == (6, 50_000, 2_000_000)


def test_drift_of_the_reference_clock() -> None:
    made = Conversation()
    start = made.time_ns
    distribute = Datagram(EcatCommand.FRMW, address(STATION, 0x0910), bytes(8))
    for _ in range(6000):  # 6 s, more than the 32 bits of the low half
        local = 123 + round((made.time_ns - start) * (1 + 50e-6))
        made.exchange(distribute, answers=[(struct.pack("<Q", local), 3)])
    stream = made.stream()
    list(stream)
    reference = stream.masters[0].reference
    assert reference is not None
    assert reference.drift_ppm is not None
    assert (reference.address, reference.datagrams) == (STATION, 6000)
    assert abs(reference.drift_ppm - 50) < 0.1
