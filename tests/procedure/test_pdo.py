"""Mappings that are read and written, with incomplete and refusing dictionaries."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Entry, Pdo
from catenary.plan.planner import make_plan
from catenary.plan.request import DeviceRequest, ObjectReference
from catenary.procedure.pdo import read_mapping, write_downloads
from catenary.wire.coe import Abort, DownloadRequest, decode_coe
from catenary.wire.mailbox import Mailbox
from tests.plan.devices import Asking, servo
from tests.procedure.player import Dictionary, MailboxDevice, channel, coe, play

POSITION = b"\x20\x00\x64\x60"
SMALL = {  # TxPDO 0x1A05 with only the position
    (0x1C13, 0): b"\x01",
    (0x1C13, 1): b"\x05\x1a",
    (0x1A05, 0): b"\x01",
    (0x1A05, 1): POSITION,
}


def read(objects: dict[tuple[int, int], bytes]) -> DeviceDescription:
    return play(read_mapping(channel(), servo(0)), MailboxDevice(Dictionary(objects)))


def test_a_direction_missing_in_the_dictionary_comes_from_the_sii() -> None:
    device = read(SMALL)
    assert device.outputs == servo(0).outputs
    assert device.inputs == (Assignment(3, (Pdo(0x1A05, (Entry(0x6064, 0, 32),), 3),)),)
    assert device.mapping_source == "CoE"


def test_an_empty_dictionary_keeps_the_mapping_of_the_sii() -> None:
    device = read({})
    assert (device.outputs, device.inputs) == (servo(0).outputs, servo(0).inputs)
    assert device.mapping_source == "SII"
    described = replace(servo(0), mapping_source="ESI drive.xml:10")
    reading = read_mapping(channel(), described)
    assert play(reading, MailboxDevice(Dictionary({}))) == described


def test_an_unreadable_list_keeps_the_mapping_of_the_sii() -> None:
    device = read({(0x1C13, 0): b"\x02", (0x1C13, 1): b"\x00\x1a"})
    assert device.inputs == servo(0).inputs


def test_unused_places_of_the_assignment_are_skipped() -> None:
    objects = SMALL | {(0x1C13, 0): b"\x02", (0x1C13, 2): b"\x00\x00"}
    assert [pdo.index for pdo in read(objects).inputs[0].pdos] == [0x1A05]


def test_pdos_without_known_entries_are_an_error() -> None:
    objects = {(0x1C13, 0): b"\x01", (0x1C13, 1): b"\x05\x1a"}
    with pytest.raises(MappingError, match="0x1A05"):
        read(objects)


class Refusing(Dictionary):
    """A dictionary that refuses to change PDO 0x1A00."""

    def __call__(self, message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        if isinstance(request, DownloadRequest) and request.index == 0x1A00:
            return [coe(Abort(request.index, request.subindex, 0x0601_0002))]
        return super().__call__(message)


def test_a_refused_mapping_is_restored() -> None:
    device = servo(0)
    request = DeviceRequest(inputs=(ObjectReference(0x60F4, 0, 32),))
    [plan] = make_plan([device], [Asking({0: request})]).devices
    dictionary = Refusing({})
    with pytest.raises(MappingError, match="the entries of PDO 0x1A00 cannot be changed"):
        play(write_downloads(channel(), device, plan), MailboxDevice(dictionary))
    emptied = (0x1C13, 0, b"\x00")
    again = [(0x1C13, 1, b"\x00\x1a"), (0x1C13, 0, b"\x01")]
    assert dictionary.written == [emptied, emptied, *again]
