"""tshark reads our Ethernet frames, and SOEM's eoe_test, unmodified, talks to a virtual device."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

import catenary as cat
from catenary.link import Recorder
from catenary.virtual import AnalogInputs, Coupler, Ethernet, Segment
from tests.peers.conftest import serving
from tests.peers.test_soem_programs import (
    BUILD_SECONDS,
    INITIALISER,
    run_or_skip,
    source,
)
from tests.procedure.test_eoe import Host
from tests.virtual.ethernet_frames import ARP_REQUEST, echo, ping

__all__ = ["source"]  # a fixture

FIELDS = ("type", "fragno", "offset", "frame", "last", "fragment")
SIZES = (0, 56, 300, 1472)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[bytes]]:
    """Record addresses and frames. Return the capture, and the frames in both directions."""
    path = tmp_path_factory.mktemp("eoe") / "eoe.pcapng"
    device = AnalogInputs(mailbox_bytes=128, protocols=[Ethernet()])
    requests = [ARP_REQUEST, *(ping(k, size) for k, size in enumerate(SIZES))]
    with Recorder(Segment([Coupler(), device]), path) as link, cat.MainDevice(link) as main:
        sub = main.scan()[1]
        sub.eoe.set_address(ip="192.168.7.2/24", gateway="192.168.7.1", name="drive")
        host = Host(sub)
        # One request after another, so that the fragments of the two directions do not mix.
        pairs = [(request, *host.exchange(request, turns=60)) for request in requests]
    assert link.dropped == 0
    assert [echo(answer) is not None for _, answer in pairs] == [False, True, True, True, True]
    return path, [frame for pair in pairs for frame in pair]


def dissect(tshark: str, path: Path, *options: str) -> list[str]:
    command = [tshark, "-r", str(path), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_tshark_finds_no_fault(tshark: str, recording: tuple[Path, list[bytes]]) -> None:
    bad = "ecat_mailbox.eoe.invalid || (_ws.malformed && ecat_mailbox.eoe.type != 0)"
    assert dissect(tshark, recording[0], "-Y", bad) == []


def test_tshark_reads_the_addresses(tshark: str, recording: tuple[Path, list[bytes]]) -> None:
    names = ("ipaddr", "subnetmask", "defaultgateway", "dnsname")
    options = [part for name in names for part in ("-e", f"ecat_mailbox.eoe.init.{name}")]
    rows = dissect(tshark, recording[0], "-Y", "ecat_mailbox.eoe.init", "-T", "fields", *options)
    assert set(rows) == {"192.168.7.2\t255.255.255.0\t192.168.7.1\tdrive"}


def test_the_frames_reassemble_from_the_fields_of_tshark(
    tshark: str, recording: tuple[Path, list[bytes]]
) -> None:
    path, expected = recording
    options = [part for name in FIELDS for part in ("-e", f"ecat_mailbox.eoe.{name}")]
    where = ("-Y", "ecat_mailbox.eoe.fragment", "-E", "occurrence=a", "-E", "aggregator=;")
    rows = dissect(tshark, path, "-T", "fields", *options, *where)
    parts = [
        part for row in rows for part in zip(*(f.split(";") for f in row.split("\t")), strict=True)
    ]
    found: list[bytes] = []
    data, before = b"", None
    for part in parts:
        if part == before:  # a written fragment appears twice: sent and returned
            continue
        before = part
        kind, number, offset, _, last, fragment = part
        assert kind == "0"
        data = b"" if number == "0" else data
        assert number == "0" or int(offset) == len(data)
        data += bytes.fromhex(fragment.replace(":", ""))
        if last == "1":
            found.append(data)
    assert found == expected


LINE = """
[[device]]
kind = "analog_inputs"
mailbox_bytes = 256
ethernet = { gateway = "192.168.7.1" }
"""


@pytest.fixture(scope="module")
def eoe_test(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the compiled program."""
    folder = tmp_path_factory.mktemp("soem")
    shutil.copytree(source / "soem", folder / "soem")
    root = folder / "soem"
    main = root / "soem" / "ethercatmain.c"
    main.write_text(main.read_text().replace(*INITIALISER))
    parts = [
        *(root / "soem").glob("*.c"),
        *(root / "osal" / "linux").glob("*.c"),
        *(root / "oshw" / "linux").glob("*.c"),
        root / "test" / "linux" / "eoe_test" / "eoe_test.c",
    ]
    places = ("soem", "osal", "osal/linux", "oshw/linux")
    command = ["gcc", "-w", "-O1", "-o", "eoe_test", *(f"-I{root / each}" for each in places)]
    command += [*map(str, parts), "-lpthread", "-lrt"]
    run_or_skip(command, folder, BUILD_SECONDS, "eoe_test cannot be compiled")
    return folder / "eoe_test"


def test_soem_sets_and_reads_the_addresses(
    eoe_test: Path, veth: tuple[str, str], tmp_path: Path
) -> None:
    """SOEM sends the fields without gaps, and understands our fixed places: all are present."""
    ours, theirs = veth
    line = tmp_path / "line.toml"
    line.write_text(LINE)
    with serving(theirs, line):
        done = subprocess.run(
            ["stdbuf", "-oL", str(eoe_test), ours], capture_output=True, text=True, timeout=120
        )
    assert "recieved IP (192.168.9.200)" in done.stdout
    assert "recieved subnet (255.255.255.0)" in done.stdout
    assert "Operational state reached for all slaves." in done.stdout
