"""The schema has the options of the API."""

from __future__ import annotations

import inspect
from dataclasses import fields

import pytest

from catenary.drive import DistributedClock, Drives, HomingMethod
from catenary.drive.process_data import ProcessData
from catenary.loop import ClockOptions, Loop, Scheduling, StopPolicy
from catenary.machine import schema
from catenary.plan.start_up_object import StartUp


def test_every_table_of_the_json_schema_refuses_unknown_keys() -> None:
    tables = schema.json_schema()["$defs"]
    assert isinstance(tables, dict)
    assert len(tables) == len(schema.Table.__subclasses__())
    assert {table["additionalProperties"] for table in tables.values()} == {False}


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
        # laws, sinks and triggers are objects of a program; clocks has a table at the top
        (
            schema.LoopTable,
            parameters(Loop),
            set(),
            {"laws", "sink", "trigger", "clocks", "capture"},
        ),
        # start-up objects and modules stand at the device; a clock is called dc in Python
        (schema.DrivesTable, parameters(Drives), {"axes", "clock"}, {"dc", "start_up", "modules"}),
        (
            schema.ProcessDataTable,
            parameters(ProcessData),
            {"device", "clock"},
            {"dc", "start_up", "modules"},
        ),
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
