"""The schema: it accepts the example, has the options of the API, and serves editors."""

from __future__ import annotations

import inspect
import os
import tomllib
from dataclasses import fields
from pathlib import Path

import jsonschema
import pytest

from catenary.drive import DistributedClock, Drives, HomingMethod
from catenary.drive.process_data import ProcessData
from catenary.loop import ClockOptions, Loop, Scheduling, StopPolicy
from catenary.machine import schema
from catenary.plan.start_up_object import StartUp
from tests.machine.files import SMALL

ROOT = Path(__file__).resolve().parent.parent.parent
SHARED = Path(os.environ.get("CATENARY_SHARED", ROOT.parent / "shared"))
EXAMPLE = SHARED / "examples" / "machine.toml"


def check(text: str) -> None:
    jsonschema.Draft202012Validator(schema.json_schema()).validate(tomllib.loads(text))


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(schema.json_schema())


def test_the_schema_accepts_a_machine_file() -> None:
    check(SMALL)


@pytest.mark.shared_data
@pytest.mark.skipif(not EXAMPLE.exists(), reason="no shared data folder")
def test_the_schema_accepts_the_example() -> None:
    check(EXAMPLE.read_text())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("period", "perod"),
        ('mode = "csp"', 'mode = "cps"'),
        ("priority = 80", "priority = 180"),
        ('name = "j1"', "name = 1"),
        (", product = 0x20004", ""),
    ],
)
def test_the_schema_refuses_mistakes(old: str, new: str) -> None:
    assert old in SMALL
    with pytest.raises(jsonschema.ValidationError):
        check(SMALL.replace(old, new, 1))


def parameters(function: object) -> set[str]:
    """Return the keyword-only options of a class."""
    found = inspect.signature(function).parameters.values()  # type: ignore[arg-type]
    return {each.name for each in found if each.kind is each.KEYWORD_ONLY}


def names(options: type) -> set[str]:
    return {field.name for field in fields(options)}


@pytest.mark.parametrize(
    ("table", "options", "own", "absent"),
    [
        (schema.StopTable, names(StopPolicy), set(), set()),
        (schema.SchedulingTable, names(Scheduling), set(), set()),
        (schema.ClocksTable, names(ClockOptions), set(), set()),
        (schema.ClockTable, names(DistributedClock), set(), set()),
        (schema.HomingTable, names(HomingMethod), set(), set()),
        # laws and sinks are objects of a program; clocks has a table at the top
        (schema.LoopTable, parameters(Loop), set(), {"laws", "sink", "clocks"}),
        # start-up objects stand at the device; a clock is called dc in Python
        (schema.DrivesTable, parameters(Drives), {"axes", "clock"}, {"dc", "start_up"}),
        (schema.ProcessDataTable, parameters(ProcessData), {"device", "clock"}, {"dc", "start_up"}),
        (
            schema.StartUpTable,
            names(StartUp) - {"_"},
            {"object", "comment"},
            {"index", "subindex"},
        ),
    ],
)
def test_the_keys_of_a_table_are_the_options_of_the_api(
    table: type[schema.Table], options: set[str], own: set[str], absent: set[str]
) -> None:
    assert set(table.__struct_fields__) - own == options - absent
