"""The table of ETG.1500 is complete, and its states agree with its tests."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import pytest

import catenary as cat

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "etg1500.md"
# ETG.1500 1.0.2, table 1; 305 has a row for reading and one for writing
NUMBERS = [
    *(101, 102, 103, 104, 105, 106, 107, 108, 201, 202, 203, 301, 302, 303, 304, 305, 305),
    *(401, 402, 403, 404, 501, 502, 503, 504, 505, 506, 601, 602, 603, 701, 702, 703),
    *(801, 901, 1001, 1101, 1102, 1103, 1201, 1301),
]
REQUIREMENT = re.compile(r"(shall|should|may)( \([\w ]+\))?")
LINK = re.compile(r"\]\(\.\./\.\./(tests/[\w/.]+)\)")


class Row(NamedTuple):
    name: str
    class_a: str
    class_b: str
    state: str
    remark: str
    tests: str


def rows() -> list[Row]:
    found = []
    for line in PAGE.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and len(cells) == 7 and cells[0].isdigit():
            number, name, *rest = cells
            found.append(Row(f"{number} {name}", *rest))
        elif line.startswith("| ") and len(cells) == 4 and cells[0] != "pack":
            name, *rest = cells
            found.append(Row(name, "may", "may", *rest))
    return found


ROWS = rows()


def test_the_table_has_every_feature() -> None:
    numbers = [int(row.name.split()[0]) for row in ROWS if row.name[0].isdigit()]
    assert numbers == NUMBERS


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_row_is_consistent(row: Row) -> None:
    assert REQUIREMENT.fullmatch(row.class_a)
    assert REQUIREMENT.fullmatch(row.class_b)
    assert row.state in ("yes", "part", "no")
    assert bool(LINK.findall(row.tests)) is (row.state != "no")
    assert row.remark or row.state == "yes" or row.class_a == "may" or row.name.startswith("1301")
    for path in LINK.findall(row.tests):
        assert (ROOT / path).is_file(), path


def test_a_missing_requirement_is_planned_and_in_the_result() -> None:
    missing = [row for row in ROWS if row.class_a.startswith("shall") and row.state != "yes"]
    assert [row.name for row in missing if "planned" not in row.remark] == []
    result = PAGE.read_text().partition("- **Class A**:")[2].partition("\n")[0]
    numbers = {row.name.split()[0] for row in missing}
    assert numbers == set()
    assert numbers == set(re.findall(r"\d{3,4}", result))


def test_a_protocol_with_an_interface_is_not_called_missing() -> None:
    """The state of a mailbox protocol agrees with the handles of a device."""
    handles = {"601": "eoe", "701": "foe", "801": "soe", "901": "aoe", "1001": "voe"}
    states = {row.name.split()[0]: row.state for row in ROWS}
    with cat.MainDevice("virtual") as main:
        device = main.scan()[2]
    for number, handle in handles.items():
        assert (states[number] != "no") is hasattr(device, handle), handle
