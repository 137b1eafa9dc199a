"""Lines of keys in TOML text."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

from catenary.toml_lines import KeyPath, key_lines, line_of

TEXT = '''\
# a comment with [brackets] = "and quotes"
format = "x" # [no.table]
a.b = 1

[loop]
"period" = "1 ms"
stop = { late_limit = 0.05, "odd key" = [1,
    2, { deep = """
text ] } with "quotes" """, last = 'c:\\' },
] }

[[device]]
name = "j1"

[[device]]
name = "j2"
[device.identity]
vendor = 2
[[device.start_up]]
object = "0x6065:00"
[[device.start_up]]
object = "0x6066:00"

[drives."arm \\u00e9".clock]
shift = -1.5e-6
when = 1979-05-27 07:32:00
text = """""quoted"""""
end = true'''


def paths(value: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Return every path of the content of a TOML file."""
    if path:
        yield path
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from paths(inner, (*path, key))


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("format",), 2),
        (("a", "b"), 3),
        (("loop",), 5),
        (("loop", "period"), 6),
        (("loop", "stop", "odd key", 0), 7),
        (("loop", "stop", "odd key", 1), 8),
        (("loop", "stop", "odd key", 2, "deep"), 8),
        (("loop", "stop", "odd key", 2, "last"), 9),
        (("device",), 12),
        (("device", 0, "name"), 13),
        (("device", 1), 15),
        (("device", 1, "identity", "vendor"), 18),
        (("device", 1, "start_up", 1, "object"), 22),
        (("drives",), 24),
        (("drives", "arm é"), 24),
        (("drives", "arm é", "clock"), 24),
        (("drives", "arm é", "clock", "end"), 28),
    ],
)
def test_the_line_of_a_path(path: KeyPath, line: int) -> None:
    assert key_lines(TEXT)[path] == line


def test_every_path_of_the_content_has_a_line() -> None:
    lines = key_lines(TEXT)
    parents = {("a",), ("drives",), ("drives", "arm é")}  # tables without a header of their own
    assert set(paths(tomllib.loads(TEXT))) - parents <= set(lines)


def test_a_missing_path_has_the_line_of_the_table_around_it() -> None:
    lines = key_lines(TEXT)
    assert line_of(lines, ("device", 1, "identity", "product")) == 17
    assert line_of(lines, ("nothing",)) == 1


def test_windows_line_ends_count_once() -> None:
    assert key_lines("a = 1\r\n\r\n[b]\r\nc = 2\r\n")[("b", "c")] == 4
