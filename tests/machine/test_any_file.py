"""Any edit of a file results in a machine, or in an error that names the line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from catenary.errors import MachineFileError
from catenary.machine import read_machine
from catenary.toml_lines import key_lines
from tests.line.test_toml_lines import paths
from tests.machine.files import SMALL

LINES = SMALL.splitlines()
WORDS = ["0", "-1", "1e400", "nan", "inf", "true", '""', '"deg"', "[]", "{}", "[[]]", "1979-05-27"]
WORDS += ['"1 deg"', '"j1"', '"0x6000:11"', "{ object = 1 }", "[true]", '"virtual"', "65536"]
REUSED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def edited(draw: st.DrawFn) -> str:
    """Return the small file with lines dropped, doubled or moved, and values exchanged."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(lines) - 1))
        key, equals, _ = lines[at].partition("=")
        match draw(st.sampled_from(["drop", "double", "move", "value", "value", "key"])):
            case "drop":
                del lines[at]
            case "double":
                lines.insert(at, lines[at])
            case "move":
                lines.insert(draw(st.integers(0, len(lines) - 1)), lines.pop(at))
            case "value" if equals:
                lines[at] = f"{key}= {draw(st.sampled_from(WORDS))}"
            case "key" if equals:
                lines[at] = (
                    f"{draw(st.sampled_from(['x', 'names', 'a.b']))} ={lines[at][len(key) + 1 :]}"
                )
    return "\n".join(lines)


def refusal(path: Path) -> MachineFileError | None:
    """Return the error of reading a file; None if it is read."""
    try:
        read_machine(path)
    except MachineFileError as error:
        return error
    return None


@REUSED
@given(edited())
def test_an_edited_file_is_read_or_refused_with_a_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    error = refusal(path)
    if error is not None:
        assert error.line is not None
        assert 1 <= error.line <= text.count("\n") + 1


@REUSED
@given(edited())
def test_every_path_of_toml_has_a_line(text: str) -> None:
    try:
        content: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    lines = key_lines(text)
    for path in paths(content):
        inner = {known for known in lines if known[: len(path)] == path}
        assert inner or not path  # itself, or a table below it that has a header


@REUSED
@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes(b'format = "catenary-machine/1"\n' + data)
    error = refusal(path)
    assert error is None or str(path) in error.message
