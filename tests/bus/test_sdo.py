"""The object dictionary of a device, without a loop."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from catenary.bus import ListType, MainDevice, SubDevice
from catenary.errors import DecodeError, MailboxError, SdoAbort
from catenary.types import UDINT, UINT, USINT, VISIBLE_STRING, Array, Record, sized
from catenary.virtual import demo_segment


@pytest.fixture
def drive() -> Iterator[SubDevice]:
    with MainDevice(demo_segment()) as main:
        yield main.scan().drives[0]


def test_complete_access_reads_a_record(drive: SubDevice) -> None:
    kind = Record({"vendor": UDINT, "product": UDINT, "revision": UDINT, "serial": UDINT})
    identity = drive.sdo.read(0x1018, 1, complete=True, type=kind)
    assert tuple(identity.values()) == tuple(drive.identity)
    with_count = Record({"entries": UINT, **kind.fields})  # subindex 0 takes 16 bits
    assert drive.sdo.read(0x1018, complete=True, type=with_count)["entries"] == 4


def test_complete_access_reads_and_writes_an_array(drive: SubDevice) -> None:
    assert drive.sdo.read(0x1C00, 1, complete=True, type=Array(USINT, 4)) == (1, 2, 3, 4)
    before = drive.sdo.read(0x1C12, complete=True)
    drive.sdo.write(0x1C12, 0, b"\x01\x00\x01\x16", complete=True)
    assert drive.sdo.read(0x1C12, 0, type=USINT) == 1
    assert drive.sdo.read(0x1C12, 1, type=UINT) == 0x1601
    assert before[:4] != b"\x01\x00\x01\x16"


def test_strings_and_sizes(drive: SubDevice) -> None:
    assert drive.sdo.read(0x1008, type=VISIBLE_STRING) == "Catenary virtual servo 1"
    assert drive.sdo.read(0x1008, type=sized(VISIBLE_STRING, 24)) == "Catenary virtual servo 1"
    with pytest.raises(DecodeError, match="needs 8 bytes, received 24"):
        drive.sdo.read(0x1008, type=sized(VISIBLE_STRING, 8))
    with pytest.raises(MailboxError, match="the limit is 100"):
        drive.sdo.read(0x2100, limit=100)


def test_a_request_without_a_loop_is_answered_at_once(drive: SubDevice) -> None:
    answer = drive.sdo.request(0x1018, 1, type=UDINT)
    assert answer.done
    assert answer.result() == drive.identity.vendor
    refused = drive.sdo.request(0x5FFF)
    assert refused.done
    assert isinstance(refused.error, SdoAbort)
    with pytest.raises(SdoAbort):
        refused.result()


def test_the_device_describes_its_objects(drive: SubDevice) -> None:
    names = {known.index: known.name for known in drive.sdo.list()}
    assert names[0x1018] == "Identity"
    identity = drive.sdo.describe(0x1018)
    assert [entry.name for entry in identity.entries][1:3] == ["Vendor ID", "Product code"]
    mappable = drive.sdo.list(ListType.RXPDO_MAPPABLE)
    assert {known.index for known in mappable} < set(names)
    assert 0x607A in {known.index for known in mappable}


def test_invalid_arguments_are_refused_before_anything_is_sent(drive: SubDevice) -> None:
    with pytest.raises(ValueError, match="subindex 0 or 1, not 2"):
        drive.sdo.read(0x1018, 2, complete=True)
    with pytest.raises(ValueError, match="an index has 16 bits"):
        drive.sdo.request(0x12345)
    with pytest.raises(TypeError, match="5 is not bytes: give its type"):
        drive.sdo.request_write(0x2102, 0, 5)  # type: ignore[call-overload]
