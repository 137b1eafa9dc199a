"""`catenary capture diff` compares the bring-ups of PySOEM and Catenary on one segment."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

import catenary as cat
from catenary.capture import read_timeline
from catenary.capture.diff import CaptureComparison, compare
from catenary.capture.difference import Mark
from catenary.cli.main import main
from catenary.errors import CatenaryError
from catenary.link import Interface, Recorder
from tests.peers.test_capture_of_pysoem import recording
from tests.peers.test_pysoem import STALLED, opened, to_operational

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")

ATTEMPTS = 5
SERVOS = (2, 3)
DRIVE_OBJECTS = ["0x6060:00 = 8", "0x60C2:01 = 5", "0x60C2:02 = 253"]  # mode, 5 ms
MAILBOX_STATUS = "FMMU in 0x080D:3 len 1 bits"


def bring_up_with_pysoem(interface: str, path: Path) -> None:
    with recording(interface, path), opened(6, interface) as master:
        to_operational(master)


def bring_up_with_catenary(interface: str, path: Path) -> None:
    with Recorder(Interface(interface), path) as link, cat.MainDevice(link) as main:
        subs = main.scan()
        axes = cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
        terminals = [cat.ProcessData(subs[position]) for position in (1, 4, 5)]
        with cat.Loop(axes, *terminals, period=5e-3) as loop:
            next(loop)


def test_the_start_up_of_pysoem_and_catenary(served: str, tmp_path: Path) -> None:
    """The registers are the same. Only Catenary writes a mode, and maps the mailbox status."""
    for _ in range(ATTEMPTS - 1):  # a stalled machine adds errors and repetitions
        with suppress(AssertionError, CatenaryError, *STALLED):
            return compare_both(served, tmp_path)
    return compare_both(served, tmp_path)


def compare_both(interface: str, folder: Path) -> None:
    soem, ours = folder / "soem.pcapng", folder / "ours.pcapng"
    bring_up_with_pysoem(interface, soem)
    bring_up_with_catenary(interface, ours)
    found = compare(read_timeline(soem), read_timeline(ours))
    assert masters(found) == ["SOEM", "Catenary"]
    assert len(found.devices) == 6
    assert all(each.pair.a and each.pair.b for each in found.devices)
    for each in found.devices:
        position = each.pair.device.position
        only_ours = [row.b for row in each.rows if row.mark is Mark.ONLY_B and row.effect]
        assert only_ours == (DRIVE_OBJECTS if position in SERVOS else [])
        others = [row for row in each.rows if row.b not in only_ours]
        assert [row.b for row in others] == [MAILBOX_STATUS] * (position in (*SERVOS, 4))
        assert not any(row.effect for row in others)
    assert found.first is not None
    assert found.first.text == "0x6060:00 of device 2, only in B"
    assert main(["capture", "diff", str(soem), str(ours)]) == 1
    assert main(["capture", "diff", str(soem), str(soem)]) == 0


def masters(found: CaptureComparison) -> list[str]:
    return [side.summary.master.name for side in (found.a, found.b) if side.summary]
