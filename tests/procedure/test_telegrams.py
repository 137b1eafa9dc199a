"""Telegrams of a device with several drives, and telegrams that cannot be read."""

from __future__ import annotations

import pytest

from catenary.errors import MailboxError, SoeError
from catenary.procedure.telegrams import ENTRIES_MAX, read_axes
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.sercos import Attribute, Display, encode_list
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.procedure.drives import fragments
from tests.procedure.player import MailboxDevice, channel, play

IDNS = Attribute(2, is_list=True, display=Display.IDN)
WORD = Attribute(2, display=Display.HEXADECIMAL)
LONG = Attribute(4, display=Display.SIGNED)
Values = dict[int, tuple[Attribute, bytes]]


def idns(*numbers: int) -> tuple[Attribute, bytes]:
    return IDNS, encode_list(b"".join(each.to_bytes(2, "little") for each in numbers))


def configurable(mdt: tuple[int, ...], at: tuple[int, ...]) -> Values:
    """Return a drive with configurable telegrams."""
    values = {each: (LONG, bytes(4)) for each in (36, 40, 47, 51)}
    values[80] = WORD, bytes(2)
    return {**values, 15: (WORD, b"\x07\x00"), 24: idns(*mdt), 16: idns(*at)}


def device(*drives: Values) -> MailboxDevice:
    """Return a device with drives. It refuses others with 0x800A."""

    def respond(message: Mailbox) -> list[Mailbox]:
        request = decode_soe(message.data)
        answer = Message(
            OpCode.READ_RESPONSE, request.number, request.elements, drive=request.drive
        )
        filled = _filled(answer)
        parts = [filled] if filled.error else fragments(request, filled.data)
        return [Mailbox(Type.SOE, each.encode()) for each in parts]

    def _filled(answer: Message) -> Message:
        values = drives[answer.drive] if answer.drive < len(drives) else None
        if values is None:
            return _refused(answer, 0x800A)
        if answer.number not in values:
            return _refused(answer, 0x1001)
        if Element.UNIT in answer.elements:
            return _refused(answer, 0x4001)
        attribute, value = values[answer.number]
        parts = {Element.ATTRIBUTE: attribute.encode(), Element.VALUE: value}
        data = b"".join(part for each, part in parts.items() if each in answer.elements)
        return Message(answer.op_code, answer.number, answer.elements, data, answer.drive)

    return MailboxDevice(respond)


def _refused(answer: Message, code: int) -> Message:
    data = code.to_bytes(2, "little")
    return Message(answer.op_code, answer.number, answer.elements, data, answer.drive, error=True)


def test_the_telegrams_of_drives_follow_one_another() -> None:
    """SOEM adds 16 bits for the words of each drive (ecx_readIDNmap)."""
    first, second = configurable((47, 80), (51,)), configurable((36,), (40, 51))
    axes = play(read_axes(channel()), device(first, second))
    assert [each.drive for each in axes] == [0, 1]
    assert [(v.idn, v.bit_offset) for axis in axes for v in axis.outputs] == [
        *(("S-0-0134", 0), ("S-0-0047", 16), ("S-0-0080", 48)),
        *(("S-0-0134", 64), ("S-0-0036", 80)),
    ]
    assert [(v.idn, v.bit_offset) for axis in axes for v in axis.inputs] == [
        *(("S-0-0135", 0), ("S-0-0051", 16)),
        *(("S-0-0135", 48), ("S-0-0040", 64), ("S-0-0051", 96)),
    ]


def test_at_most_eight_drives_are_read() -> None:
    """A device that answers for all numbers has eight drives."""
    drives = [configurable((47,), (51,))] * 8
    axes = play(read_axes(channel()), device(*drives))
    assert [each.drive for each in axes] == list(range(8))
    assert axes[-1].outputs[-1].bit_offset == 7 * 48 + 16


def test_a_standard_telegram_needs_no_lists() -> None:
    values = configurable((), ())
    del values[24], values[16]
    [axis] = play(read_axes(channel()), device({**values, 15: (WORD, b"\x05\x00")}))
    assert [each.idn for each in axis.outputs] == ["S-0-0134", "S-0-0047", "S-0-0036"]
    assert [each.idn for each in axis.inputs] == ["S-0-0135", "S-0-0051", "S-0-0040"]


def test_a_drive_without_telegram_type_has_lists() -> None:
    values = configurable((47,), (51,))
    del values[15]
    [axis] = play(read_axes(channel()), device(values))
    assert (axis.telegram_type, axis.is_configurable, len(axis.outputs)) == (None, True, 2)


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({24: idns(4000)}, SoeError, "S-0-4000: read refused with 0x1001"),
        ({24: idns(*[47] * (ENTRIES_MAX + 1))}, MailboxError, "at most 64 IDNs"),
        ({24: (LONG, bytes(4))}, MailboxError, "S-0-0024: not a list"),
        ({24: idns(16)}, MailboxError, "S-0-0016 is a list: a telegram cannot contain it"),
        ({24: (IDNS, b"\xff\xff\xff\xff")}, MailboxError, "its header states 65535 bytes"),
    ],
)
def test_lists_that_are_not_valid(changes: Values, error: type[Exception], text: str) -> None:
    values = {**configurable((47,), (51,)), **changes}
    with pytest.raises(error, match=text):
        play(read_axes(channel()), device(values))
