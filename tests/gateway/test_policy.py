"""The policy as a matrix: each kind of message against permission and enabled axes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.gateway.policy import Policy, axis_slots, is_dangerous, is_read
from catenary.gateway.request import Access, read_request
from catenary.gateway.transfer import Kind, Transfer, continues, has_answer
from catenary.model.device import DeviceDescription
from catenary.wire import coe, foe
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.sdo_information import ListType, Opcode, SdoInformation, list_request
from tests.gateway.line import Line


@pytest.fixture(scope="module")
def device() -> DeviceDescription:
    """Return a servo. Its default mapping has the objects 0x6040, 0x607A, 0x6041 and others."""
    with Line() as line:
        return line.main.subs[1].description


def download(index: int, *, complete: bool = False) -> Mailbox:
    value = coe.DownloadRequest(index, 0, bytes(4), 4, expedited=True, complete_access=complete)
    return Mailbox(Type.COE, value.encode())


READS = {
    "upload": Mailbox(Type.COE, coe.UploadRequest(0x6040, 0).encode()),
    "complete upload": Mailbox(Type.COE, coe.UploadRequest(0x1C12, 0, True).encode()),
    "list": Mailbox(Type.COE, list_request(ListType.ALL).encode()),
    "file": Mailbox(Type.FOE, foe.ReadRequest("log").encode()),
}
SAFE_WRITES = {
    f"0x{index:04X}": index for index in (0x1010, 0x2100, 0x6065, 0x6865, 0x8000, 0xF030)
}
DANGEROUS = {
    f"0x{index:04X}": index
    for index in (
        *(0x1600, 0x1607, 0x16FF, 0x1A00, 0x1AFF, 0x1C10, 0x1C12, 0x1C13, 0x1C1F),
        *(0x6040 + 0x800 * slot for slot in range(16)),
        *(0x6060 + 0x800 * slot for slot in range(16)),
        *(0x607A, 0x6041, 0x6064),
    )
}
OTHERS = {
    **{kind.name: Mailbox(kind, bytes(20)) for kind in (Type.AOE, Type.EOE, Type.SOE, Type.VOE)},
    "file write": Mailbox(Type.FOE, foe.WriteRequest("app").encode()),
    "RxPDO": Mailbox(Type.COE, (coe.Service.RXPDO << 12).to_bytes(2, "little") + bytes(8)),
    "SDO response": Mailbox(Type.COE, coe.DownloadResponse(0x6040, 0).encode()),
    "response of a list": Mailbox(Type.COE, SdoInformation(Opcode.LIST_RESPONSE, b"").encode()),
    "block download": Mailbox(Type.COE, b"\x00\x20\xc0\x40\x60\x00" + bytes(4)),
    "truncated": Mailbox(Type.COE, b"\x00\x20\x23\x65\x60"),
    "empty": Mailbox(Type.COE, b""),
    "FoE op-code": Mailbox(Type.FOE, b"\x09" + bytes(9)),
    "error": Mailbox(Type.ERROR, bytes(4)),
}


@pytest.mark.parametrize("message", READS.values(), ids=READS.keys())
def test_reads(message: Mailbox, device: DeviceDescription) -> None:
    request = read_request(message)
    assert request.access is Access.READ
    assert is_read(request, None)
    assert not is_dangerous(request, None, device)


@pytest.mark.parametrize("complete", [False, True], ids=["", "complete"])
@pytest.mark.parametrize("index", SAFE_WRITES.values(), ids=SAFE_WRITES.keys())
def test_writes_that_pass_while_an_axis_is_enabled(
    index: int, complete: bool, device: DeviceDescription
) -> None:
    request = read_request(download(index, complete=complete))
    assert not is_read(request, None)
    assert not is_dangerous(request, None, device)


@pytest.mark.parametrize("complete", [False, True], ids=["", "complete"])
@pytest.mark.parametrize("index", DANGEROUS.values(), ids=DANGEROUS.keys())
def test_writes_that_do_not(index: int, complete: bool, device: DeviceDescription) -> None:
    request = read_request(download(index, complete=complete))
    assert not is_read(request, None)
    assert is_dangerous(request, None, device)


@pytest.mark.parametrize("message", OTHERS.values(), ids=OTHERS.keys())
def test_everything_else_is_a_dangerous_write(message: Mailbox, device: DeviceDescription) -> None:
    request = read_request(message)
    assert not is_read(request, None)
    assert is_dangerous(request, None, device)


@pytest.mark.parametrize("index", [0x6040, 0x1C12, 0x6065])
def test_a_segment_is_judged_by_the_object_of_its_transfer(
    index: int, device: DeviceDescription
) -> None:
    begin = coe.DownloadRequest(index, 0, b"", 4)
    first = read_request(Mailbox(Type.COE, begin.encode()))
    segment = read_request(Mailbox(Type.COE, coe.DownloadSegment(False, True, b"1234").encode()))
    transfer = Transfer(Kind.DOWNLOAD, first)
    assert continues(transfer, segment)
    assert not continues(None, segment)
    assert not is_read(segment, transfer)
    assert not is_read(segment, None)
    assert is_dangerous(segment, transfer, device) == (index != 0x6065)


def test_packets_of_a_file_are_judged_by_their_transfer(device: DeviceDescription) -> None:
    data = read_request(Mailbox(Type.FOE, foe.Data(1, b"x").encode()))
    acknowledge = read_request(Mailbox(Type.FOE, foe.Acknowledge(1).encode()))
    reading = Transfer(Kind.FILE_READ, read_request(READS["file"]))
    writing = Transfer(Kind.FILE_WRITE, read_request(OTHERS["file write"]))
    assert is_read(acknowledge, reading)
    assert not continues(reading, data)
    assert not continues(writing, acknowledge)
    assert not is_read(data, writing)
    assert is_dangerous(data, writing, device)


def test_only_the_protocol_of_a_transfer_ends_it() -> None:
    reading = Transfer(Kind.FILE_READ, read_request(READS["file"]))
    error = read_request(Mailbox(Type.FOE, foe.Error(0x8000).encode()))
    abort = read_request(Mailbox(Type.COE, coe.Abort(0x6040, 0, 0x08000000).encode()))
    assert continues(reading, error)
    assert not continues(reading, abort)
    assert not continues(None, abort)


def test_the_request_of_a_file_is_repeated_after_busy() -> None:
    request = read_request(READS["file"])
    reading = Transfer(Kind.FILE_READ, request)
    assert continues(reading, read_request(READS["file"]))
    assert not continues(reading, read_request(Mailbox(Type.FOE, foe.ReadRequest("b").encode())))
    # After the last packet, the same request begins a new transfer
    assert not continues(replace(reading, ends=True), request)
    assert has_answer(None, request)


def test_a_permission_ends_if_another_device_is_found_at_the_position() -> None:
    with Line() as line:
        sub = line.main.subs[1]
        policy = Policy(line.main, [1])
        first = sub.description
        assert policy.permits(sub)
        assert not policy.permits(line.main.subs[2])
        for part, permitted in (("revision", True), ("serial", False), ("product", False)):
            other = first.identity._replace(**{part: 77})
            sub.description = replace(first, identity=other)
            assert policy.permits(sub) == permitted


def test_a_device_that_receives_a_controlword_has_an_axis(device: DeviceDescription) -> None:
    assert axis_slots(device) == (0,)
    assert axis_slots(replace(device, slots=())) == (0,)
    assert axis_slots(replace(device, slots=(), outputs=())) == ()
    assert axis_slots(replace(device, slots=(0, 2))) == (0, 2)
