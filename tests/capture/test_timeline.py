"""Timelines of the captures in the shared data, compared with tshark."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

import catenary as cat
from catenary.capture import Timeline, read_timeline
from catenary.capture.contents import AddressAssigned, IdentityRead, StateReached
from catenary.capture.mailbox_contents import SdoTransfer
from catenary.capture.register_contents import SyncUnitWrite
from catenary.errors import SdoAbort
from catenary.link import Recorder
from catenary.types import UDINT
from catenary.virtual import demo_segment
from catenary.wire.al import AlState

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
