"""PDOs that a device offers, and notes about its mapping."""

from __future__ import annotations

from dataclasses import replace

from catenary.model.device import Direction, Entry, ObjectValue, Pdo
from catenary.procedure.pdo_offers import read_first_mapping, read_offers, read_values
from catenary.wire.mailbox import Mailbox, Type
from tests.plan.devices import SERVO_INPUTS, servo
from tests.procedure.player import Dictionary, MailboxDevice, channel, play

POSITION = b"\x20\x00\x64\x60"


def test_pdos_without_known_entries_are_noted() -> None:
    objects = {(0x1C13, 0): b"\x01", (0x1C13, 1): b"\x05\x1a"}
    run = read_first_mapping(channel(), servo(0))
    device = play(run, MailboxDevice(Dictionary(objects)))
    assert device.inputs == servo(0).inputs
    [note] = device.notes
    assert "that of its SII is used" in note
    assert "0x1A05" in note


def test_a_malformed_answer_about_pdos_is_noted() -> None:
    malformed = MailboxDevice(lambda _: [Mailbox(Type.COE, b"\x00\x30\x43")])
    device = play(read_first_mapping(channel(), servo(0)), malformed)
    assert device.inputs == servo(0).inputs
    [note] = device.notes
    assert "its mapping cannot be read" in note


def test_entries_that_differ_from_the_sii_are_noted() -> None:
    objects = {(0x1C13, 0): b"\x01", (0x1C13, 1): b"\x00\x1a", (0x1A00, 0): b"\x01"}
    objects[0x1A00, 1] = POSITION
    device = play(read_first_mapping(channel(), servo(0)), MailboxDevice(Dictionary(objects)))
    [note] = device.notes
    assert note.startswith("PDO 0x1A00 has 0x6064:00/32, but its SII specifies 0x6041:00/16, ")
    assert device.inputs[0].pdos[0].entries == (SERVO_INPUTS[3],)


def test_offered_entries_come_from_the_dictionary() -> None:
    before = servo(0)
    offered = Pdo(0x1A05, (Entry(0x6041, 0, 16),), None)
    before = replace(before, input_pdos=(*before.input_pdos, offered))
    run = read_offers(channel(), before, Direction.INPUT)
    device = play(run, MailboxDevice(Dictionary({(0x1A05, 0): b"\x01", (0x1A05, 1): POSITION})))
    assert device.input_pdos[-1].entries == (Entry(0x6064, 0, 32),)
    assert device.inputs == before.inputs


def test_unreadable_values_are_none() -> None:
    run = read_values(channel(), servo(0), [(0x6060, 0), (0x6065, 0), (0x6060, 0)])
    device = play(run, MailboxDevice(Dictionary({(0x6060, 0): b"\x01"})))
    assert device.values == (ObjectValue(0x6060, 0, b"\x01"), ObjectValue(0x6065, 0, None))
    assert device.known_value(0x6060, 0) == b"\x01"
