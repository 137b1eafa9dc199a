"""Mappings read and written by hand: dictionaries without lists, with odd PDOs, that refuse."""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.errors import MappingError
from catenary.model.device import Assignment, DeviceDescription, Direction, Entry, ObjectValue, Pdo
from catenary.plan.planner import make_plan
from catenary.plan.request import DeviceRequest, ObjectReference
from catenary.procedure.pdo import read_mapping, write_downloads
from catenary.procedure.pdo_offers import read_first_mapping, read_offers, read_values
from catenary.wire.coe import Abort, DownloadRequest, decode_coe
from catenary.wire.mailbox import Mailbox, Type
from tests.plan.devices import SERVO_INPUTS, Asking, servo
from tests.procedure.by_hand import Dictionary, MailboxDevice, channel, coe, play

POSITION = b"\x20\x00\x64\x60"
SMALL = {  # TxPDO 0x1A05 with the position alone
    (0x1C13, 0): b"\x01",
    (0x1C13, 1): b"\x05\x1a",
    (0x1A05, 0): b"\x01",
    (0x1A05, 1): POSITION,
}


def read(objects: dict[tuple[int, int], bytes]) -> DeviceDescription:
    return play(read_mapping(channel(), servo(0)), MailboxDevice(Dictionary(objects)))


def test_a_direction_that_the_dictionary_does_not_show_is_the_siis() -> None:
    device = read(SMALL)
    assert device.outputs == servo(0).outputs
    assert device.inputs == (Assignment(3, (Pdo(0x1A05, (Entry(0x6064, 0, 32),), 3),)),)
    assert device.mapping_source == "CoE"


def test_a_dictionary_that_shows_nothing_leaves_the_sii() -> None:
    device = read({})
    assert (device.outputs, device.inputs) == (servo(0).outputs, servo(0).inputs)
    assert device.mapping_source == "SII"


def test_a_list_that_cannot_be_read_to_its_end_is_the_siis() -> None:
    device = read({(0x1C13, 0): b"\x02", (0x1C13, 1): b"\x00\x1a"})
    assert device.inputs == servo(0).inputs


def test_places_kept_free_are_no_pdos() -> None:
    objects = SMALL | {(0x1C13, 0): b"\x02", (0x1C13, 2): b"\x00\x00"}
    assert [pdo.index for pdo in read(objects).inputs[0].pdos] == [0x1A05]


def test_pdos_without_entries_anywhere_are_a_note_in_a_scan() -> None:
    objects = {(0x1C13, 0): b"\x01", (0x1C13, 1): b"\x05\x1a"}
    with pytest.raises(MappingError, match="0x1A05"):
        read(objects)
    run = read_first_mapping(channel(), servo(0))
    device = play(run, MailboxDevice(Dictionary(objects)))
    assert device.inputs == servo(0).inputs
    [note] = device.notes
    assert "that of its SII is used" in note
    assert "0x1A05" in note


def test_a_malformed_answer_about_pdos_is_a_note_in_a_scan() -> None:
    malformed = MailboxDevice(lambda _: [Mailbox(Type.COE, b"\x00\x30\x43")])
    device = play(read_first_mapping(channel(), servo(0)), malformed)
    assert device.inputs == servo(0).inputs
    [note] = device.notes
    assert "its mapping cannot be read" in note


def test_entries_that_differ_from_the_sii_are_a_note() -> None:
    objects = {(0x1C13, 0): b"\x01", (0x1C13, 1): b"\x00\x1a", (0x1A00, 0): b"\x01"}
    objects[0x1A00, 1] = POSITION
    device = play(read_first_mapping(channel(), servo(0)), MailboxDevice(Dictionary(objects)))
    [note] = device.notes
    assert note.startswith("PDO 0x1A00 has 0x6064:00/32, but its SII specifies 0x6041:00/16, ")
    assert device.inputs[0].pdos[0].entries == (SERVO_INPUTS[3],)


def test_what_a_pdo_offers_is_the_dictionarys() -> None:
    before = servo(0)
    offered = Pdo(0x1A05, (Entry(0x6041, 0, 16),), None)
    before = replace(before, input_pdos=(*before.input_pdos, offered))
    run = read_offers(channel(), before, Direction.INPUT)
    device = play(run, MailboxDevice(Dictionary(SMALL)))
    assert device.input_pdos[-1].entries == (Entry(0x6064, 0, 32),)
    assert device.inputs == before.inputs


def test_values_that_cannot_be_read_are_not_known() -> None:
    run = read_values(channel(), servo(0), [(0x6060, 0), (0x6065, 0), (0x6060, 0)])
    device = play(run, MailboxDevice(Dictionary({(0x6060, 0): b"\x01"})))
    assert device.values == (ObjectValue(0x6060, 0, b"\x01"), ObjectValue(0x6065, 0, None))
    assert device.known_value(0x6060, 0) == b"\x01"


class Refusing(Dictionary):
    """Owns a dictionary that does not let PDO 0x1A00 be written."""

    def __call__(self, message: Mailbox) -> list[Mailbox]:
        request = decode_coe(message.data)
        if isinstance(request, DownloadRequest) and request.index == 0x1A00:
            return [coe(Abort(request.index, request.subindex, 0x0601_0002))]
        return super().__call__(message)


def test_a_refused_mapping_is_taken_back_step_by_step() -> None:
    device = servo(0)
    request = DeviceRequest(inputs=(ObjectReference(0x60F4, 0, 32),))
    [plan] = make_plan([device], [Asking({0: request})]).devices
    dictionary = Refusing({})
    with pytest.raises(MappingError, match="the entries of PDO 0x1A00 cannot be changed"):
        play(write_downloads(channel(), device, plan), MailboxDevice(dictionary))
    emptied = (0x1C13, 0, b"\x00")
    again = [(0x1C13, 1, b"\x00\x1a"), (0x1C13, 0, b"\x01")]
    assert dictionary.written == [emptied, emptied, *again]
