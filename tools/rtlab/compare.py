"""Comparison of the medians of two runs of a table."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tools.rtlab.errors import LabError

MEDIAN = "p50"
THEIRS = ("published", "date", "machine")  # prefixes of values that are not measured
# Keys that identify an entry of a list
NAMES = ("load", "way", "who", "event", "rate", "name")  # words: ok


def compare(one: Path, other: Path) -> str:
    """Return a line for each table that two results, or folders of results, have in common.

    Raises:
        LabError: There is no common table, or the results are from different commands.
    """
    if one.is_dir() and other.is_dir():
        names = sorted(
            {file.name for file in one.glob("rtlab-*.json") if (other / file.name).exists()}
        )
        if not names:
            raise LabError(f"{one} and {other} have no table in common")
        return "\n".join(compare(one / name, other / name) for name in names)
    first, second = read(one), read(other)
    if first["command"] != second["command"]:
        raise LabError(
            f"{one} and {other} are from two commands: {first['command']}, {second['command']}"
        )
    return f"{one.stem}: {furthest(first['result'], second['result'])}"


def read(file: Path) -> dict[str, Any]:
    """Read a result file.

    Raises:
        LabError: The file is not a result of the lab.
    """
    try:
        found: dict[str, Any] = json.loads(file.read_text())
        found["command"], found["result"]
    except (ValueError, KeyError, TypeError) as error:
        raise LabError(f"{file} is not a result of the lab ({error})") from None
    return found


def furthest(one: object, other: object) -> str:
    """Return a text on the largest difference between medians of the same name."""
    first, second = dict(medians(one)), dict(medians(other))
    apart = {name: difference(first[name], second[name]) for name in first if name in second}
    if not apart:
        return "no medians"
    name = max(apart, key=lambda each: apart[each])
    return (
        f"{len(apart)} medians, at most {apart[name]:.2%} apart: "
        f"{name} {first[name]:g}, {second[name]:g}"
    )


def difference(one: float, other: float) -> float:
    """Return the difference relative to the larger magnitude."""
    return abs(one - other) / max(abs(one), abs(other)) if one != other else 0.0


def medians(value: object, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield each median with its path."""
    if isinstance(value, Mapping):
        if isinstance(value.get(MEDIAN), float | int):
            yield path, value[MEDIAN]
        for key, each in value.items():
            if not key.startswith(THEIRS):
                yield from medians(each, f"{path}/{key}".lstrip("/"))
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from medians(each, f"{path}/{label(each, number)}")


def label(entry: object, number: int) -> str:
    known = (
        [str(entry[name]) for name in NAMES if name in entry] if isinstance(entry, Mapping) else []
    )
    return ", ".join(known) or str(number)
