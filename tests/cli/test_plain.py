"""Values for JSON."""

from __future__ import annotations

import math
from pathlib import Path

from catenary.cli.plain import plain
from catenary.model.process_data import Direction, Entry
from catenary.wire.sii import MailboxProtocol


def test_a_dataclass_becomes_an_object() -> None:
    found = plain(Entry(0x6040, 0, 16, "Controlword"))
    assert isinstance(found, dict)
    assert (found["index"], found["name"], found["enumeration"]) == (0x6040, "Controlword", [])


def test_enumerations_become_names() -> None:
    assert plain(Direction.INPUT) == "input"
    assert plain(MailboxProtocol.COE | MailboxProtocol.FOE) == ["coe", "foe"]
    assert plain(MailboxProtocol(0x8000 | int(MailboxProtocol.COE))) == ["coe", "0x8000"]


def test_values_that_json_lacks() -> None:
    given = {1: b"\x01\xff", "path": Path("/a"), "numbers": (1.5, math.nan, -math.inf)}
    assert plain(given) == {"1": "01ff", "path": "/a", "numbers": [1.5, None, None]}
