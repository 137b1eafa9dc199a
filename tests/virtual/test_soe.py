"""SoE of a virtual drive at message level, and its segment table."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import catenary as cat
from catenary.virtual import Segment, SercosDrive, SoeQuirks, read_segment
from catenary.virtual.soe.parameter import Parameter, Refusal, idn, packed
from catenary.wire.sercos import decode_attribute
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.virtual.main_device import STATION, MainDevice

PRE_OP, SOE = 2, 5
READ, WRITE = 1, 3
STATE, NAME, ATTRIBUTE, VALUE = 0x01, 0x02, 0x04, 0x40
SIZE = 128
ROOM = SIZE - 10


class Client:
    """SoE messages to one drive, each as bytes."""

    def __init__(self, drive: SercosDrive) -> None:
        self.main = MainDevice(Segment([drive]))
        self.main.number_stations()
        self.main.start_mailbox(STATION, SIZE)

    def ask(self, flags: int, elements: int, number: int, data: bytes = b"") -> list[Message]:
        """Return the answers to a request."""
        message = struct.pack("<BBH", flags, elements, number) + data
        assert self.main.put(STATION, message, kind=SOE, size=SIZE) == 1
        answers: list[Message] = []
        while (answer := self.main.fetch(STATION, SIZE)) is not None:
            [length] = struct.unpack_from("<H", answer)
            assert answer[5] & 0x0F == SOE
            answers.append(decode_soe(answer[6 : 6 + length]))
        return answers

    def read(self, text: str, elements: int = VALUE) -> bytes:
        """Return the data of all fragments of an answer."""
        answers = self.ask(READ, elements, idn(text))
        assert [each.incomplete for each in answers] == [True] * (len(answers) - 1) + [False]
        assert not answers[-1].error, hex(answers[-1].code)
        return b"".join(each.data for each in answers)

    def code(self, flags: int, elements: int, text: str, data: bytes = b"") -> int:
        """Return the error code of the answer; 0: no error."""
        [answer] = self.ask(flags, elements, idn(text), data)
        return answer.code


@pytest.fixture
def client() -> Client:
    return Client(SercosDrive())


def test_elements_follow_one_another(client: Client) -> None:
    data = client.read("S-0-0047", NAME | ATTRIBUTE | VALUE)
    name = b"Position command value"
    assert data[:4] == struct.pack("<HH", len(name), len(name))
    assert data[4 : 4 + len(name)] == name
    assert decode_attribute(data[4 + len(name) :][:4]).size == 4
    assert len(data) == 4 + len(name) + 4 + 4


def test_fragments_count_down(client: Client) -> None:
    answers = client.ask(READ, VALUE, idn("P-0-0018"))
    last = len(answers) - 1
    assert last > 10
    assert [each.number for each in answers[:-1]] == list(range(last, 0, -1))
    assert answers[-1].number == idn("P-0-0018")
    assert all(len(each.data) == ROOM for each in answers[:-1])


def test_a_write_in_fragments_and_a_repeated_fragment(client: Client) -> None:
    content = bytes(range(200))
    whole = struct.pack("<HH", 200, 200) + content
    assert client.ask(WRITE | 0x08, VALUE, 1, whole[:ROOM]) == []
    assert client.ask(WRITE | 0x08, VALUE, 1, whole[:ROOM]) == []  # its frame was lost
    assert client.code(WRITE, VALUE, "P-0-0018", whole[ROOM:]) == 0
    assert client.read("P-0-0018")[4:] == content


def test_a_write_that_was_not_completed_is_forgotten(client: Client) -> None:
    content = bytes(range(200))
    whole = struct.pack("<HH", 200, 200) + content
    assert client.ask(WRITE | 0x08, VALUE, 7, bytes(ROOM)) == []
    assert client.ask(WRITE | 0x08, VALUE, 1, whole[:ROOM]) == []
    assert client.code(WRITE, VALUE, "P-0-0018", whole[ROOM:]) == 0
    assert client.read("P-0-0018")[4:] == content
    assert client.ask(WRITE | 0x08, VALUE, 1, bytes(ROOM)) == []
    assert client.read("S-0-0002") == (1000).to_bytes(2, "little")
    assert client.code(WRITE, VALUE, "S-0-0002", (500).to_bytes(2, "little")) == 0


def test_a_write_without_end_is_refused(client: Client) -> None:
    answers: list[Message] = []
    for left in range(700, 0, -1):
        answers += client.ask(WRITE | 0x08, VALUE, left, bytes(ROOM))
    assert answers[0].code == 0x7003
    assert answers[0].number > 1  # the number of the fragment
    assert client.read("S-0-0002") == (1000).to_bytes(2, "little")


@pytest.mark.parametrize(
    ("flags", "elements", "text", "data", "code"),
    [
        (READ, VALUE, "S-0-4000", b"", 0x1001),
        (READ, 0, "S-0-0047", b"", 0x800C),
        (READ, STATE, "S-0-0047", b"", 0x7014),
        (READ, 0x80, "S-0-0047", b"", 0x8001),
        (READ, 0x08, "S-0-0032", b"", 0x4001),
        (READ | 0x20, VALUE, "S-0-0047", b"", 0x800A),
        (WRITE, NAME, "S-0-0047", b"", 0x2004),
        (WRITE, VALUE, "S-0-0047", bytes(3), 0x7002),
        (WRITE, VALUE, "S-0-0047", bytes(5), 0x7003),
        (WRITE, VALUE, "S-0-0051", bytes(4), 0x7004),
        (WRITE, VALUE, "S-0-0024", b"", 0x7002),
        (WRITE, VALUE, "S-0-0024", bytes.fromhex("040004002f00"), 0x7002),
        (WRITE, VALUE, "S-0-0024", bytes.fromhex("020002002f002400"), 0x7003),
        (WRITE, VALUE, "S-0-0024", bytes.fromhex("020002000f00"), 0x7008),
        (WRITE, VALUE, "S-0-0099", bytes(3), 0x7008),
        (WRITE, VALUE, "S-0-0099", b"\x09\x00", 0x7008),
    ],
)
def test_refusals(
    client: Client, flags: int, elements: int, text: str, data: bytes, code: int
) -> None:
    assert client.code(flags, elements, text, data) == code


def test_a_short_message_and_an_unknown_service(client: Client) -> None:
    assert client.main.put(STATION, b"\x01\x40", kind=SOE, size=SIZE) == 1
    answer = client.main.fetch(STATION, SIZE)
    assert answer is not None
    assert answer[5] & 0x0F == 0
    assert client.ask(7, VALUE, 47) == []
    assert client.ask(5, VALUE, 47) == []


@settings(max_examples=30, deadline=None)
@given(st.lists(st.binary(max_size=ROOM + 4), max_size=4))
def test_any_messages_are_survived(messages: list[bytes]) -> None:
    client = Client(SercosDrive())
    for each in messages:
        client.main.put(STATION, each, kind=SOE, size=SIZE)
        while client.main.fetch(STATION, SIZE) is not None:
            pass
    client.ask(WRITE, VALUE, 0x7FFF)  # ends an unfinished write
    assert client.read("S-0-0140")[4:] == b"Catenary virtual SERCOS drive"


def test_a_command_runs_and_is_cleared(client: Client) -> None:
    client.main.let_pass(50)
    written, end = client.ask(WRITE, VALUE, 127, b"\x03\x00")
    assert (written.op_code, written.error) == (OpCode.WRITE_RESPONSE, False)
    assert end == Message(OpCode.NOTIFICATION, 127, Element.STATE, b"\x03\x00")
    assert client.read("S-0-0127", STATE) == b"\x03\x00"
    assert int.from_bytes(client.read("S-0-0135"), "little") == 0x8020  # change bit
    assert client.code(WRITE, VALUE, "S-0-0127", b"\x03\x00") == 0x7010
    assert client.code(WRITE, VALUE, "S-0-0127", bytes(2)) == 0
    assert client.read("S-0-0127", STATE) == bytes(2)
    client.main.let_pass(2)
    assert int.from_bytes(client.read("S-0-0135"), "little") == 0x8000


def test_a_stuck_command_is_interrupted_and_cancelled() -> None:
    client = Client(SercosDrive(soe_quirks=SoeQuirks(stuck_commands=("S-0-0264",))))
    for value, state in ((3, 7), (1, 5), (0, 0)):
        assert client.code(WRITE, VALUE, "S-0-0264", value.to_bytes(2, "little")) == 0
        client.main.let_pass(20)
        assert client.read("S-0-0264", STATE) == state.to_bytes(2, "little")


def test_the_eeprom_has_soe_and_no_coe(client: Client) -> None:
    image = SercosDrive().sii_image()
    assert int.from_bytes(image[0x38:0x3A], "little") == 0x0010


def test_a_segment_file_has_the_drive(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text(
        '[[device]]\nkind = "sercos_drive"\nresolution = 4096\n'
        'soe_quirks = { one_element = true, refused = { "S-0-0140" = 0x7005 } }\n'
    )
    with cat.MainDevice(read_segment(file)) as main:
        [sub] = main.scan()
        assert sub.soe.read("S-0-0079") == 4096
        with pytest.raises(cat.errors.SoeError, match="0x7005"):
            sub.soe.read("S-0-0140")


@pytest.mark.parametrize(
    "options",
    [{"refused": {"47": 1}}, {"stuck_commands": ("x",)}, {"fragment_bytes": -1}],
)
def test_quirks_are_checked(options: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"IDN|fragment_bytes"):
        SoeQuirks(**options)  # type: ignore[arg-type]


def test_an_unknown_idn_of_the_drive() -> None:
    with pytest.raises(ValueError, match="has no S-0-4000"):
        SercosDrive().idn_value("S-0-4000")


def test_a_parameter_checks_its_limits() -> None:
    parameter = Parameter(1, "x", 2, minimum=1, maximum=5, protection=0)
    for value, code in ((0, 0x7006), (6, 0x7007)):
        with pytest.raises(Refusal) as refusal:
            parameter.write(value.to_bytes(2, "little"), PRE_OP)
        assert refusal.value.code == code
    parameter.write(b"\x05\x00", PRE_OP)
    assert parameter.value() == packed([5])
