import argparse
from pathlib import Path

import pytest

from catenary.cli.arguments import (
    Entry,
    entry,
    number,
    position,
    positive_minutes,
    positive_seconds,
    result_file,
)


@pytest.mark.parametrize(
    ("text", "value"), [("17", 17), ("0x1F", 31), ("0b101", 5), ("-3", -3), ("0xff", 255)]
)
def test_number_is_decimal_or_hexadecimal(text: str, value: int) -> None:
    assert number(text) == value


@pytest.mark.parametrize("text", ["", "1F", "0x", "1.5", "five"])
def test_number_refuses_other_text(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number"):
        number(text)


@pytest.mark.parametrize(
    ("text", "index", "subindex"),
    [("0x6041", 0x6041, 0), ("0x1018:1", 0x1018, 1), ("0x1018:0x04", 0x1018, 4)],
)
def test_entry(text: str, index: int, subindex: int) -> None:
    assert entry(text) == Entry(index, subindex)


def test_entry_without_0x_gets_a_hint() -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="write 0x6041"):
        entry("6041")


@pytest.mark.parametrize("text", ["0x10000", "0x1018:256", "0x1018:-1", "-1"])
def test_entry_refuses_values_out_of_range(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="out of range"):
        entry(text)


@pytest.mark.parametrize("text", ["-1", "65536"])
def test_position_refuses_values_out_of_range(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="outside"):
        position(text)


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "soon"])
def test_seconds_are_positive_and_finite(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        positive_seconds(text)


def test_the_error_for_minutes_names_the_unit() -> None:
    assert positive_minutes("0.5") == 0.5
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number of minutes"):
        positive_minutes("N")


def test_result_file_refuses_paths_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert result_file(str(tmp_path / "new.json")) == tmp_path / "new.json"
    with pytest.raises(argparse.ArgumentTypeError, match="is a folder"):
        result_file(str(tmp_path))
    with pytest.raises(argparse.ArgumentTypeError, match=r"folder .* does not exist"):
        result_file(str(tmp_path / "nowhere" / "new.json"))
    with pytest.raises(argparse.ArgumentTypeError, match=r"folder .* does not exist"):
        result_file(str(tmp_path / ("x" * 300) / "new.json"))  # os.stat raises OSError
    monkeypatch.setattr("os.access", lambda path, mode: False)  # root may write everything
    with pytest.raises(argparse.ArgumentTypeError, match="cannot be written"):
        result_file(str(tmp_path / "new.json"))
