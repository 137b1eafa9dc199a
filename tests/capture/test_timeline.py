"""Timelines of the captures in the shared data, compared with tshark; large and damaged files."""

from __future__ import annotations

import io
import subprocess
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.capture import EventStream, Timeline, read_timeline
from catenary.capture.contents import AddressAssigned, IdentityRead, StateReached
from catenary.capture.file import CaptureFile
from catenary.capture.mailbox_contents import SdoTransfer
from catenary.capture.notes import notes
from catenary.capture.register_contents import SyncUnitWrite
from catenary.errors import DecodeError, SdoAbort
from catenary.link import Recorder
from catenary.types import UDINT
from catenary.virtual import demo_segment
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from catenary.wire.pcapng import Packet, encode_header, encode_packet, encode_statistics
from tests.capture.made import Conversation, capture_of

# masters: name, frames sent and returned, products of their devices
ETHERCRAB, SOEM = "ethercrab", "SOEM"
EK1100, EK1914, EL1004, EL2828 = 0x044C2C52, 0x077A2C52, 0x03EC3052, 0x0B0C3052
EL2889, EL3004 = 0x0B493052, 0x0BBC3052
CAPTURES = {
    "ecrab_replay-dc.pcapng": [(ETHERCRAB, 1802, 1802, [EK1100, EL2828, EL2889])],
    "ecrab_replay-ek1100-el2828-el2889.pcapng": [(ETHERCRAB, 1789, 1789, [EK1100, EL2828, EL2889])],
    "ecrab_replay-ek1914-el3004-configure.pcapng": [(ETHERCRAB, 552, 552, [EK1914, EL3004])],
    "ecrab_replay-ek1914-segmented-upload.pcapng": [(ETHERCRAB, 482, 482, [EK1914, EL3004])],
    "ecrab_rs-example-sii-el2004.ecatonly.pcapng": [(ETHERCRAB, 127, 127, [None] * 3)],
    "ecrab_soem-sdinfo-ek1100-el1004.ecatonly.pcapng": [(SOEM, 290, 290, [EK1100, EL1004])],
    "ecrab_soem-sdinfo-ek1100-only.ecatonly.pcapng": [(SOEM, 94, 94, [EK1100])],
    "ecrab_soem-sdinfo-no-slaves.ecatonly.pcapng": [(SOEM, 19, 0, [])],
    "ecrab_twincat-scan-boxes.ecatonly.pcapng": [
        ("TwinCAT", 0, 3, []),
        ("TwinCAT", 705, 704, [EK1100, EL1004]),
    ],
}


def timeline(shared_data: Path, name: str) -> Timeline:
    return read_timeline(shared_data / "pcap" / name)


@pytest.mark.parametrize("name", CAPTURES)
def test_masters_and_devices(shared_data: Path, name: str) -> None:
    found = timeline(shared_data, name)
    assert [
        (
            *(each.master.name, each.master.sent, each.master.returned),
            [device.product for device in each.devices],
        )
        for each in found.masters
    ] == CAPTURES[name]
    assert found.counts.malformed == found.counts.other == 0


def fields(tshark: str, path: Path, where: str, *names: str) -> list[tuple[str, ...]]:
    options = [part for name in ("frame.number", *names) for part in ("-e", name)]
    command = [tshark, "-r", str(path), "-Y", where, "-T", "fields", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [tuple(line.split("\t")) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("name", CAPTURES)
def test_tshark_finds_the_same_addresses(shared_data: Path, tshark: str, name: str) -> None:
    path = shared_data / "pcap" / name
    where = "ecat.cmd == 2 && ecat.ado == 0x10 && ecat.cnt == 1 && eth.src[0] & 2"
    seen = fields(tshark, path, where, "ecat.data", "ecat.reg.physaddr")
    found = [
        (event.packet, event.content.station)
        for event in read_timeline(path).events
        if isinstance(event.content, AddressAssigned)
    ]
    words = {int(number): int(address or data, 0) for number, data, address in seen if address}
    if len(words) == len(seen):  # this version of tshark names the register
        assert dict(found) == {number: word & 0xFFFF for number, word in words.items() if word}
    assert [number for number, _ in found] == [int(line[0]) for line in seen]


@pytest.mark.parametrize("name", CAPTURES)
def test_tshark_finds_the_same_sdo_writes(shared_data: Path, tshark: str, name: str) -> None:
    path = shared_data / "pcap" / name
    where = "ecat_mailbox.coe.sdoreq == 1 && eth.src[0] & 2 && ecat.cmd == 5"
    seen = fields(tshark, path, where, "ecat_mailbox.coe.sdoidx", "ecat_mailbox.coe.sdosub")
    found = [
        (event.content.index, event.content.subindex)
        for event in read_timeline(path).events
        if isinstance(event.content, SdoTransfer) and event.content.writes
    ]
    assert found == [(int(index, 0), int(subindex, 0)) for _, index, subindex in seen]


def test_tshark_finds_the_same_cycles(shared_data: Path, tshark: str) -> None:
    path = shared_data / "pcap" / "ecrab_replay-dc.pcapng"
    where = "ecat.cmd == 12 && eth.src[0] & 2"
    seen = fields(tshark, path, where, "ecat.cmd", "ecat.cnt")
    [master] = read_timeline(path).masters
    [cycles] = master.cycles
    assert cycles.frames == len(seen) == 257
    counters = [
        int(counter)
        for _, commands, counters in seen
        for command, counter in zip(commands.split(","), counters.split(","), strict=True)
        if command == "0x0c"
    ]
    assert cycles.working_counters == (max(counters),)
    distributed = fields(tshark, path, "ecat.cmd == 14 && eth.src[0] & 2", "ecat.cnt")
    assert master.reference is not None
    assert master.reference.datagrams == len(distributed)


def test_the_bring_up_with_distributed_clocks(shared_data: Path) -> None:
    found = timeline(shared_data, "ecrab_replay-dc.pcapng")
    reached = [
        event.content.state
        for event in found.events
        if event.device == 2 and isinstance(event.content, StateReached)
    ]
    up = [AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP]
    assert reached == up + up[-2::-1]
    sync = [
        (event.device, str(event.step), event.content)
        for event in found.events
        if isinstance(event.content, SyncUnitWrite) and event.content.assign_activate
    ]
    assert [(device, step, c.accepted) for device, step, c in sync] == [
        (0, "PRE→SAFE", True),
        (1, "PRE→SAFE", False),  # EL2828 has no clocks
        (2, "PRE→SAFE", True),
    ]
    assert (sync[0][2].assign_activate, sync[0][2].sync0_ns) == (0x0300, 5_000_000)


def test_the_assignment_of_pdos(shared_data: Path) -> None:
    found = timeline(shared_data, "ecrab_replay-ek1914-el3004-configure.pcapng")
    writes = [
        (str(event.step), event.content.place, event.content.data.hex())
        for event in found.events
        if isinstance(event.content, SdoTransfer) and event.content.writes
    ]
    assert writes == [
        ("PRE-OP", "0x1C12:00", "00"),
        ("PRE-OP", "0x1C13:00", "00"),
        ("PRE-OP", "0x1C13:01", "001a"),
        ("PRE-OP", "0x1C13:02", "021a"),
        ("PRE-OP", "0x1C13:03", "041a"),
        ("PRE-OP", "0x1C13:04", "061a"),
        ("PRE-OP", "0x1C13:00", "04"),
    ]


def test_our_own_bring_up(tmp_path: Path) -> None:
    """The timeline shows what the program did."""
    path = tmp_path / "run.pcapng"
    with Recorder(demo_segment(clock="virtual"), path) as link, cat.MainDevice(link) as main:
        subs = main.scan()
        subs.drives[0].sdo.write(0x6065, 0, 5000, type=UDINT)
        with pytest.raises(SdoAbort):
            subs.drives[0].sdo.read(0x5FFF)
        identities = [sub.identity for sub in subs]
    found = read_timeline(path)
    [master] = found.masters
    assert (master.master.name, master.master.lost) == ("Catenary", 0)
    assert [(d.vendor, d.product, d.revision, d.serial) for d in master.devices] == [
        (each.vendor, each.product, each.revision, each.serial) for each in identities
    ]
    transfers = {
        (event.device, event.content.index): event.content
        for event in found.events
        if isinstance(event.content, SdoTransfer)
    }
    assert transfers[2, 0x6065].data == (5000).to_bytes(4, "little")
    assert transfers[2, 0x5FFF].abort == 0x06020000
    read = [event for event in found.events if isinstance(event.content, IdentityRead)]
    assert {found.device_of(event) for event in read} == set(master.devices)


class Endless:
    """A file that is made while it is read."""

    def __init__(self, parts: Iterator[bytes]) -> None:
        self._parts = parts
        self._held = b""

    def read(self, size: int) -> bytes:
        while len(self._held) < size and (part := next(self._parts, b"")):
            self._held += part
        data, self._held = self._held[:size], self._held[size:]
        return data


def cyclic(frames: int) -> Iterator[bytes]:
    """Yield a capture of process data in which each answer has another working counter."""
    yield encode_header("eth0")
    for i in range(frames):
        sent = Datagram(EcatCommand.LRW, 0x10000, bytes(1400), i & 0x7F)
        back = Datagram(EcatCommand.LRW, 0x10000, bytes(1400), i & 0x7F, working_counter=3 + i % 2)
        yield encode_packet(Packet(1_000_000 * i, encode_frame([sent])))
        source = b"\x12" + b"\x10" * 5
        yield encode_packet(Packet(1_000_000 * i + 50_000, encode_frame([back], source=source)))


def peak(frames: int) -> int:
    """Return the largest memory [bytes] while a capture is read."""
    stream = EventStream(Endless(cyclic(frames)).read)
    tracemalloc.start()
    try:
        count = sum(1 for _ in stream)
        assert count >= frames - 2
        assert stream.counts.packets == 2 * frames
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_file() -> None:
    """The second file has 11 MB more than the first, and as many more events."""
    small, large = peak(1000), peak(5000)
    assert large < 1.2 * small + 100_000


@pytest.fixture
def made() -> Conversation:
    conversation = Conversation()
    for _ in range(5):
        conversation.read(0x0130, b"\x08\x00")
    return conversation


def read_counts(data: bytes) -> CaptureFile:
    file = CaptureFile(io.BytesIO(data).read)
    list(file)
    return file


def test_a_truncated_file_is_read_up_to_its_end(made: Conversation) -> None:
    counts = read_counts(capture_of(made.packets)[:-10]).counts
    assert (counts.ethercat, counts.damaged) == (9, "")
    assert counts.cut > 0
    assert "ends in the middle of a packet" in "".join(notes(counts, ()))


def test_a_damaged_block_ends_the_timeline(made: Conversation) -> None:
    data = capture_of(made.packets[:4]) + b"\x06\0\0\0" + b"\x0d\0\0\0" + bytes(20)
    counts = read_counts(data).counts
    assert counts.ethercat == 4
    assert counts.damaged.startswith("after packet 4: pcapng: block at byte")


def test_other_packets_are_counted(made: Conversation) -> None:
    frame = made.packets[0].data
    made.packets.insert(3, Packet(made.packets[2].time_ns, frame[:12] + b"\x08\x06" + bytes(46)))
    made.packets.insert(5, Packet(made.packets[4].time_ns, frame[:20]))
    made.packets.insert(6, Packet(made.packets[4].time_ns, frame[:20], original_length=60))
    counts = read_counts(capture_of(made.packets)).counts
    assert (counts.packets, counts.ethercat, counts.other) == (13, 10, 1)
    assert (counts.malformed, counts.shortened) == (1, 1)
    assert counts.first_malformed.startswith("packet 6: ")
    assert len(list(notes(counts, ()))) == 3


def test_dropped_packets_are_reported(made: Conversation) -> None:
    statistics = encode_statistics(9, received=20, dropped=10)
    counts = read_counts(capture_of(made.packets) + statistics).counts
    assert counts.dropped == 10
    assert "dropped 10 packets" in "".join(notes(counts, ()))


def test_reading_stops_at_a_time(made: Conversation) -> None:
    stream = EventStream(io.BytesIO(capture_of(made.packets)).read, until_ns=1_500_000)
    list(stream)
    assert stream.counts.packets == 4


@pytest.mark.parametrize(
    ("data", "reason", "hint"),
    [
        (b"", "begins with nothing", "Wireshark"),
        (b"hello world, this is text", "not a pcapng or pcap file", "Wireshark"),
        (b"\x1f\x8b\x08\x00" + bytes(20), "1f8b", "gunzip"),
    ],
)
def test_other_files_are_refused(data: bytes, reason: str, hint: str) -> None:
    with pytest.raises(DecodeError, match=reason) as refused:
        EventStream(io.BytesIO(data).read)
    assert hint in refused.value.hint


@pytest.mark.parametrize("change", [lambda t: -t, lambda t: 0, lambda t: t * 10**9])
def test_wrong_times_do_not_stop_the_timeline(
    made: Conversation, change: Callable[[int], int]
) -> None:
    packets = [
        Packet(10**19 + change(i), packet.data) if i else packet
        for i, packet in enumerate(made.packets)
    ]
    stream = EventStream(io.BytesIO(capture_of(packets)).read)
    list(stream)
    assert stream.counts.ethercat == 10


@pytest.mark.parametrize("form", ["pcap", "nsecpcap"])
def test_the_format_makes_no_difference(
    shared_data: Path, tshark: str, tmp_path: Path, form: str
) -> None:
    path = shared_data / "pcap" / "ecrab_replay-ek1914-el3004-configure.pcapng"
    converted = tmp_path / f"converted.{form}"
    command = [tshark, "-r", str(path), "-F", form, "-w", str(converted)]
    subprocess.run(command, check=True, capture_output=True)
    expected, found = read_timeline(path), read_timeline(converted)
    assert len(found.events) == len(expected.events)
    for a, b in zip(found.events, expected.events, strict=True):
        assert (a.packet, a.device, a.step, a.content.kind) == (
            *(b.packet, b.device, b.step, b.content.kind),
        )
        assert abs(a.time_ns - b.time_ns) <= 2000  # times in us are cut
