"""tshark dissects recorded SoE: requests, answers, fragments, refusals, commands, telegrams.

Version 4.0 shows an IDN as the error code (packet-ecatmb.c), so the codes are not compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import catenary as cat
from catenary.errors import SoeError
from catenary.link import Recorder
from catenary.virtual import Coupler, Segment, SercosDrive
from tests.link.dissector import dissect

LARGE = list(range(520))  # 2080 bytes in mailboxes of 128 bytes
ROOM = 128 - 6 - 4
READ, ANSWER, WRITE, WRITTEN, NOTIFICATION = "1", "2", "3", "4", "5"
LIST, COMMAND, TORQUE, UNKNOWN = "0x8012", "0x0063", "0x005c", "0x0fff"


class Row(NamedTuple):
    """Fields of one message, as tshark shows them."""

    op_code: str
    incomplete: str
    error: str
    drive: str
    value: str  # 1: the message has the value
    idn: str
    left: str
    data: str

    @property
    def size(self) -> int:
        """Size of the data [bytes]."""
        return len(self.data.replace(":", "")) // 2


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a scan, a list in both directions, a refusal, a command, and some cycles."""
    path = tmp_path_factory.mktemp("tshark") / "soe.pcapng"
    segment = Segment([Coupler(), SercosDrive(mailbox_bytes=128)])
    with Recorder(segment, path) as link, cat.MainDevice(link) as main:
        drive = main.scan()[1]
        drive.soe.write("P-0-0018", LARGE)
        assert drive.soe.read("P-0-0018") == LARGE
        drive.soe.write("S-0-0092", 150.5)
        drive.soe.command("S-0-0099")
        drive.soe.describe("S-0-0047")
        with pytest.raises(SoeError):
            drive.soe.read("S-0-4095")
        with pytest.raises(SoeError):
            drive.soe.read("S-0-0047", drive=7)
        drive.soe.configure_telegrams(mdt=["S-0-0047"], at=["S-0-0051", "S-0-0040"])
        with cat.Loop(cat.ProcessData(drive)) as loop:
            for _ in range(10):
                next(loop)
    assert link.dropped == 0
    return path


@pytest.fixture(scope="module")
def rows(tshark: str, recording: Path) -> list[Row]:
    """Return the messages, each once: a written one is sent and returned."""
    fields = (
        *("opcode", "header_incomplete", "header_error", "header_driveno", "header_value"),
        *("idn", "frag", "data"),
    )
    found = dissect(tshark, recording, *(f"ecat_mailbox.soe_{each}" for each in fields))
    messages: Iterator[Row] = (Row(*each) for each in found if each[0])
    kept: list[Row] = []
    for each in messages:
        returned = each.op_code in (READ, WRITE) and kept and each == kept[-1]
        if returned:
            continue
        kept.append(each)
    return kept


def test_tshark_finds_no_fault(tshark: str, recording: Path) -> None:
    faults = dissect(tshark, recording, "_ws.malformed", "_ws.expert.severity")
    assert [each for each in faults if any(each)] == []


@pytest.mark.parametrize(("op_code", "attribute"), [(WRITE, 0), (ANSWER, 4)])
def test_a_list_passes_in_fragments_that_count_down(
    rows: list[Row], op_code: str, attribute: int
) -> None:
    """The answer has the attribute before the value."""
    parts = [each for each in rows if each.op_code == op_code]
    end = next(k for k, each in enumerate(parts) if each.idn == LIST and each.size > 4)
    count = (attribute + 4 + 4 * len(LARGE)) // ROOM
    whole = parts[end - count : end + 1]
    assert [each.left for each in whole] == [f"0x{n:04x}" for n in range(count, 0, -1)] + [""]
    assert [each.incomplete for each in whole] == ["1"] * count + ["0"]
    assert {each.idn for each in whole[:-1]} == {""}
    data = bytes.fromhex("".join(each.data for each in whole).replace(":", ""))
    assert data[attribute + 4 :] == b"".join(each.to_bytes(4, "little") for each in LARGE)


def test_requests_have_their_answers(rows: list[Row]) -> None:
    assert len(rows) > 100
    before: Row | None = None
    for each in rows:
        if each.op_code in (ANSWER, WRITTEN) and each.incomplete == "0" and before is not None:
            assert (each.idn, each.drive, each.value) == (before.idn, before.drive, before.value)
        if each.op_code in (READ, WRITE) and each.incomplete == "0":
            before = each


def test_refusals_are_marked(rows: list[Row]) -> None:
    refused = [each for each in rows if each.error == "1"]
    assert {(UNKNOWN, "0"), ("0x002f", "7")} <= {(each.idn, each.drive) for each in refused}
    assert {each.op_code for each in refused} == {ANSWER}


def test_the_command_is_started_and_cleared(rows: list[Row]) -> None:
    written = [each.data for each in rows if each.op_code == WRITE and each.idn == COMMAND]
    assert [each.replace(":", "") for each in written] == ["0300", "0000"]
    assert [each.idn for each in rows if each.op_code == NOTIFICATION] == [COMMAND]


def test_a_number_with_decimals_is_written_as_an_integer(rows: list[Row]) -> None:
    [written] = [each.data for each in rows if each.op_code == WRITE and each.idn == TORQUE]
    assert written.replace(":", "") == (1505).to_bytes(2, "little").hex()
