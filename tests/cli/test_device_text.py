"""Text from devices is data: no command prints its control characters."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from catenary.cli.failure import describe, one_line, with_hint
from catenary.cli.main import main
from catenary.cli.tables import table
from catenary.cli.text import escaped
from catenary.errors import MailboxError

EVIL = "\x1b[2J\r\n\x9b31m\u202e"
SEGMENT = """
[[device]]
kind = "servo"
name = "arm"
mailbox_quirks = { text_prefix = "\\u001b[2J\\r\\n\\u0007\\u009b", object_list = "missing" }
sii_quirks = { text_prefix = "\\u001b[2J\\r\\n\\u0007\\u009b", mailbox_size = %d }
"""


@pytest.fixture
def target(tmp_path: Path) -> str:
    return made(tmp_path, SEGMENT % 128)


def made(folder: Path, *devices: str) -> str:
    """Return the target of a virtual segment with these devices."""
    path = folder / "segment.toml"
    path.write_text("".join(devices))
    return f"virtual:{path}"


def servo(settings: str) -> str:
    return f'[[device]]\nkind = "servo"\n{settings}\n'


def call(line: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    status = main(line.split())
    printed = capsys.readouterr()
    return status, printed.out, printed.err


@pytest.mark.parametrize(
    "command",
    [
        "scan {}",
        "scan {} --json",
        "state {}",
        "state {} --json",
        "graph {}",
        "graph {} --dot",
        "diag {}",
        "diag {} --json",
        "alias {} 0",
        "alias {} 0 --json",
        "sdo read {} 0 0x1008",
        "sdo read {} 0 0x1008 --type STRING",
        "sdo read {} 0 0x1008 --type STRING --json",
        "sdo read {} 0 0x5FFF",
        "sdo list {}  0",
        "sdo list {} 0 --values",
        "sdo list {} 0 --values --json",
    ],
)
def test_no_command_prints_control_characters(
    command: str, target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out, err = call(command.format(target), capsys)
    assert out or err
    assert all(line.isprintable() for line in (out + err).split("\n"))
    assert "internal error" not in err


def test_an_error_of_the_scan_is_escaped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(f"scan {made(tmp_path, SEGMENT % 65535)}", capsys)
    assert status == 1
    assert "failed" in out
    assert "error: device 0" in err
    assert all(line.isprintable() for line in (out + err).split("\n"))


def test_a_string_is_printed_with_escapes(target: str, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(f"sdo read {target} 0 0x1008 --type STRING", capsys)
    assert out == "\\x1b[2J\\r\\n\\x07\\x9barm\n"


def test_a_truncated_list_is_printed_with_a_note(
    target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(f"sdo list {target} 0 --json", capsys)
    assert status == 0
    assert {0x1000, 0x1018} <= {row["index"] for row in json.loads(out)}
    assert err.startswith("note: the list of objects is truncated: ")


@pytest.mark.parametrize(
    "quirks",
    [
        "malformed_descriptions = [0x1008, 0x1018]",
        "missing_descriptions = [0x1008]",
        "uncounted_aborts = true",
        'object_list = "promised"',
    ],
)
def test_sdo_list_prints_the_descriptions_of_the_device(
    quirks: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = made(tmp_path, servo(f"mailbox_quirks = {{ {quirks} }}"))
    for option in ("", " --values --json"):
        status, out, _ = call(f"sdo list {target} 0{option}", capsys)
        assert status == 0
        assert "Statusword" in out or quirks.startswith("object_list")
        assert "Device type" in out


def test_an_object_without_a_description_has_a_row_and_a_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = made(tmp_path, servo("mailbox_quirks = { malformed_descriptions = [0x1008] }"))
    _, out, err = call(f"sdo list {target} 0", capsys)
    assert re.search(r"^0x1008 +\(not described\)$", out, re.MULTILINE)
    assert err.startswith("note: 0x1008 cannot be described: invalid SDO information")
    _, out, _ = call(f"sdo list {target} 0 --json", capsys)
    [row] = [row for row in json.loads(out) if row["index"] == 0x1008]
    assert (row["subindex"], row["problem"]) == (None, "not described")


def test_an_error_of_another_device_does_not_prevent_a_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = made(tmp_path, servo("sii_quirks = { mailbox_size = 8 }"), servo("serial = 2"))
    status, out, _ = call(f"sdo read {target} 1 0x1018:4 --type UDINT", capsys)
    assert (status, out) == (0, "2\n")
    status, out, err = call(f"sdo read {target} 0 0x1018:4 --type UDINT", capsys)
    assert (status, out) == (1, "")
    assert "device 0" in err


def test_escaped_characters() -> None:
    assert escaped(EVIL) == r"\x1b[2J\r\n\x9b31m\u202e"
    assert escaped("Größe 5 µm, 20 °C") == "Größe 5 µm, 20 °C"
    assert table([("a", EVIL)]) == "a  " + escaped(EVIL)
    error = MailboxError(f"device 1 ({EVIL}) is odd", hint=f"ask {EVIL}")
    assert one_line(EVIL) == r"\x1b[2J \x9b31m\u202e"
    assert with_hint(error).count("\n") == 1
    assert all(line.isprintable() for line in with_hint(error).split("\n"))
    assert all(part.isprintable() for part in describe(error))
