"""Conversion of command-line arguments. Numbers are decimal, or hexadecimal with 0x."""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

FIRST_OBJECT = 0x1000  # lower indices are data types, ETG.1000.6 §5.6.7.1


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of an object dictionary."""

    index: int
    subindex: int


class AliasPlace(NamedTuple):
    """Place of a device: `offset` devices after the one with a station alias."""

    alias: int
    offset: int = 0

    def __str__(self) -> str:
        return f"@{self.alias}:{self.offset}" if self.offset else f"@{self.alias}"


def number(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a number (decimal, or hexadecimal as 0x1F)"
        ) from None


def place(text: str) -> int | AliasPlace:
    """Parse a position such as `2`, or a place by station alias such as `@10` or `@10:1`."""
    if not text.startswith("@"):
        return position(text)
    alias, _, offset = text[1:].partition(":")
    found = AliasPlace(number(alias), position(offset or "0"))
    if not 1 <= found.alias <= 0xFFFF:
        raise argparse.ArgumentTypeError(f"alias {found.alias} is outside 1 to 65535")
    return found


def position(text: str) -> int:
    value = number(text)
    if not 0 <= value <= 0xFFFF:
        raise argparse.ArgumentTypeError(f"position {value} is outside 0 to 65535")
    return value


def share_name(text: str) -> str:
    """Return the name of a share. The form of a target, such as `share:arm`, is accepted."""
    return text.strip().removeprefix("share:")


def password(text: str) -> int:
    value = number(text)
    if not 0 <= value <= 0xFFFF_FFFF:
        raise argparse.ArgumentTypeError(f"password {text} does not fit into 32 bits")
    return value


def entry(text: str) -> Entry:
    """Parse an entry such as `0x6041` or `0x1018:1`."""
    index_text, _, subindex_text = text.partition(":")
    if index_text.isalnum() and not index_text.lower().startswith("0x"):
        raise argparse.ArgumentTypeError(
            f"index {index_text!r} is not hexadecimal; write 0x{index_text}"
        )
    index, subindex = number(index_text), number(subindex_text or "0")
    if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
        raise argparse.ArgumentTypeError(
            f"{text!r} is out of range: the maximum index is 0xFFFF, the maximum subindex 255"
        )
    if index < FIRST_OBJECT:
        raise argparse.ArgumentTypeError(f"index 0x{index:04X} is below the first object 0x1000")
    return Entry(index, subindex)


def positive_number(text: str) -> int:
    value = number(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not positive")
    return value


def positive_numbers(text: str) -> list[int]:
    """Parse a list of numbers such as `4000,8000`."""
    return [positive_number(each) for each in text.split(",")]


def fifo_priority(text: str) -> int:
    value = number(text)
    if not 1 <= value <= 99:
        raise argparse.ArgumentTypeError(f"priority {text} is outside 1 to 99 (SCHED_FIFO)")
    return value


def positive_seconds(text: str) -> float:
    return _positive_time(text, "seconds")


def positive_minutes(text: str) -> float:
    return _positive_time(text, "minutes")


def _positive_time(text: str, unit: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of {unit}") from None
    if not 0.0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} {unit} is not between 0 and 1e6")
    return value


def result_file(text: str) -> Path:
    """Return the path of a result file. Raises ArgumentTypeError if it cannot be written."""
    path = Path(text)
    if os.path.isdir(path):  # `isdir` raises no exception if access is refused
        raise argparse.ArgumentTypeError(f"{text} is a folder")
    if not os.path.isdir(path.parent):
        raise argparse.ArgumentTypeError(f"the folder {path.parent} does not exist")
    if not os.access(path if os.path.exists(path) else path.parent, os.W_OK):
        raise argparse.ArgumentTypeError(f"{text} cannot be written: no permission")
    return path


def output_file(text: str) -> str:
    """Return the path of a file that can be written, or "-" for stdout."""
    return text if text == "-" else str(result_file(text))


def seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds") from None
    if not 0.0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"{text} s is not between 0 and 1e9 s")
    return value
