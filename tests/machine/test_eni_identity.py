"""Identities and names of the devices of an ENI."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import IdentityError, SegmentError
from catenary.esi.eni import read_eni
from catenary.machine.eni.machine import device_names
from catenary.virtual import Coupler, Segment
from tests.esi.eni_file import write_eni
from tests.machine.eni_bus import device_of, segment_of

PDI_WATCHDOG = 0x0410


def test_another_device_is_named_with_both_identities(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    segment = segment_of(read_eni(path))
    other = write_eni(tmp_path, ("<ProductCode>198948", "<ProductCode>198949"))
    with (
        pytest.raises(IdentityError, match=r'device "Drive".*0x00030925.*0x00030924'),
        cat.Machine(other, target=segment),
    ):
        pass
    assert segment[0].core.peek(0, PDI_WATCHDOG, 2) != b"\xea\x03"


def write_checked(folder: Path, mask: str = "") -> Path:
    """Write a file with another revision than that of the device, and its comparison."""
    commands = (
        "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd><Adp>0</Adp><Ado>1282</Ado>"
        "<Data>00010c000000</Data></InitCmd><InitCmd><Transition>IP</Transition><Cmd>1</Cmd>"
        "<Adp>0</Adp><Ado>1288</Ado><Data>00000000</Data><Validate><Data>21040100</Data>"
        f"{mask}<Timeout>100</Timeout></Validate></InitCmd>"
    )
    return write_eni(
        folder,
        ("</Mailbox>\n   <InitCmds>", f"</Mailbox>\n   <InitCmds>{commands}"),
        ("<RevisionNo>66592", "<RevisionNo>66593"),
    )


def test_the_masked_bits_of_a_revision_are_compared(tmp_path: Path) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    path = write_checked(tmp_path, "<DataMask>f0ffffff</DataMask>")
    with cat.Machine(path, target=segment) as machine:
        assert any("the ENI has revision 0x00010421" in note for note in machine.notes)
    path = write_checked(tmp_path, "<DataMask>0f000000</DataMask>")
    expected = "revision 0x00010421 under mask 0x0000000F, found 0x00010420"
    with pytest.raises(IdentityError, match=expected), cat.Machine(path, target=segment):
        pass


def test_a_checked_revision_is_compared(tmp_path: Path) -> None:
    segment = segment_of(read_eni(write_eni(tmp_path)))
    path = write_checked(tmp_path)
    with (
        pytest.raises(IdentityError, match=r"revision 0x00010421, found .* revision 0x00010420"),
        cat.Machine(path, target=segment),
    ):
        pass


def test_additional_and_missing_devices(tmp_path: Path) -> None:
    path = write_eni(tmp_path)
    drive = device_of(read_eni(path).devices[0])
    with cat.Machine(path, target=Segment([drive, Coupler()])) as machine:
        assert any("position 1" in note and "not in the file" in note for note in machine.notes)
    info = "<Slave><Info><Name>Box</Name><AutoIncAddr>65535</AutoIncAddr><VendorId>1</VendorId>"
    info += "<ProductCode>2</ProductCode></Info></Slave>"
    segment = segment_of(read_eni(path))
    path = write_eni(tmp_path, ("<Cyclic>", f"{info}<Cyclic>"))
    with (
        pytest.raises(SegmentError, match='device "Box": no device has position 1'),
        cat.Machine(path, target=segment),
    ):
        pass


def test_each_device_has_a_name_of_its_own(tmp_path: Path) -> None:
    [device] = read_eni(write_eni(tmp_path)).devices
    eni = replace(
        read_eni(write_eni(tmp_path)),
        devices=tuple(
            replace(device, position=position, name=name)
            for position, name in enumerate(["Drive", "Drive", "Drive 1", "Box"])
        ),
    )
    assert device_names(eni) == ["Drive 0", "Drive 1", "Drive 1 2", "Box 3"]
