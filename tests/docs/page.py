"""Runs the examples of a page: Python blocks in their order, in one namespace, in virtual time.

docs/README.md explains the comments by which a page controls this.
"""

from __future__ import annotations

import re
import signal
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, Never

import pytest
from sybil import Document, Example, Region, Sybil
from sybil.parsers.myst import CodeBlockParser, PythonCodeBlockParser

import catenary as cat
from catenary.link import LinkSource, Ring
from catenary.virtual import Segment, demo_segment

ROOT = Path(__file__).resolve().parents[2]
COMMENT = re.compile(r"<!--\s*(no-test|test)(?::[ \t]*|\s*\n)(.*?)\s*-->", re.DOTALL)
FILE_NAME = re.compile(r"# ([\w.-]+\.toml)$", re.MULTILINE)
SKIP = "skip the next block"
ENDLESS = 40.0  # [s] of the loop's time, after which a loop without an end is left
TIME_LIMIT = 60  # [s] of this machine's time for a page


class LeftEndlessLoop(KeyboardInterrupt):
    """Stand-in for a reader's Ctrl-C in an endless loop."""


def parse_comments(document: Document) -> Iterable[Region]:
    """Yield `<!-- test: code -->` and `<!-- no-test: reason -->`."""
    for match in COMMENT.finditer(document.text):
        evaluate = run_hidden if match[1] == "test" else skip_next
        yield Region(match.start(), match.end(), textwrap.dedent(match[2]), evaluate)


def run_hidden(example: Example) -> None:
    code = compile("\n" * example.line + example.parsed, example.path, "exec")
    exec(code, example.namespace)


def skip_next(example: Example) -> None:
    assert example.parsed, f"{example.path}:{example.line}: no-test needs a reason"
    example.namespace[SKIP] = True


def parse_python(document: Document) -> Iterable[Region]:
    """Yield the Python blocks; an endless loop in one ends after a while."""
    for region in PythonCodeBlockParser()(document):
        region.evaluator = unless_skipped(region.evaluator)
        yield region


def parse_files(document: Document) -> Iterable[Region]:
    """Yield the TOML blocks. One whose first line is `# NAME.toml` is written to that file."""
    yield from CodeBlockParser("toml", unless_skipped(write_file))(document)


def unless_skipped(evaluate: Any) -> Callable[[Example], object]:
    def run(example: Example) -> object:
        if example.namespace.pop(SKIP, False):
            return None
        try:
            return evaluate(example)
        except LeftEndlessLoop:
            return None

    return run


def write_file(example: Example) -> None:
    tomllib.loads(example.parsed)
    name = FILE_NAME.match(example.parsed)
    if name is not None:
        Path(name[1]).write_text(example.parsed)


PAGES = Sybil([parse_comments, parse_python, parse_files])


class Wires:
    """Virtual segments in the place of this machine's interfaces.

    A page may set `eth0` in its namespace to a segment, or to an end of a segment. Otherwise each
    use of a name makes a new demo segment.
    """

    def __init__(self, namespace: dict[str, Any]) -> None:
        self.namespace = namespace

    def interface(self, name: str) -> LinkSource:
        found = self.namespace.get(name)
        return found if hasattr(found, "open_link") else demo_segment()

    def ring(self, target: str) -> LinkSource:
        first, second = (name.strip() for name in target.split(","))
        if first not in self.namespace:
            segment = demo_segment(ring=True)
            return Ring(segment.first, segment.second)
        return Ring(self.interface(first), self.interface(second))


class Helpers:
    """Functions for the `<!-- test: ... -->` comments."""

    def __init__(self, stack: ExitStack) -> None:
        self.stack = stack

    def three_drives(self, target: Any = "eth0") -> tuple[Any, Any, Any]:
        """Return `main, subs, arm` of the three drives; the end of the page closes them."""
        main = self.stack.enter_context(cat.MainDevice(target))
        subs = main.scan()
        return main, subs, cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=1.0)

    def open_loop(self, *requests: Any, period: float = 1e-3) -> Any:
        """Return an open loop; the end of the page closes it."""
        return self.stack.enter_context(cat.Loop(*requests, period=period))

    def ring(self) -> tuple[Any, Any]:
        """Return both ends of a new segment, for `eth0, eth1 = ring()`."""
        segment: Segment = demo_segment(ring=True)
        return segment.first, segment.second


def leave_endless_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a `for cycle in loop` end after a while, as by Ctrl-C."""
    original = cat.Loop.__iter__

    def iterate(self: cat.Loop) -> Iterator[cat.Cycle]:
        begin = None
        for cycle in original(self):
            begin = cycle.time if begin is None else begin
            if cycle.time - begin > ENDLESS:
                raise LeftEndlessLoop
            yield cycle

    monkeypatch.setattr(cat.Loop, "__iter__", iterate)


@contextmanager
def time_limit(path: Path) -> Iterator[None]:
    def fail(_signal: int, _frame: FrameType | None) -> Never:
        raise TimeoutError(f"{path.name}: the examples took more than {TIME_LIMIT} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(TIME_LIMIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def run_page(path: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Run the examples of a page in the present folder. Return their number."""
    document = PAGES.parse(path)
    namespace = document.namespace
    wires = Wires(namespace)
    parse = import_module("catenary.target.parse")
    monkeypatch.setattr(parse, "Interface", wires.interface)
    monkeypatch.setattr(parse, "_ring", wires.ring)
    monkeypatch.setattr(sys, "argv", [path.name])
    leave_endless_loops(monkeypatch)
    count = 0
    with time_limit(path), ExitStack() as stack:
        helpers = Helpers(stack)
        namespace |= {"three_drives": helpers.three_drives, "open_loop": helpers.open_loop}
        namespace |= {"ring": helpers.ring, "__name__": "__main__"}
        for example in document.examples():
            example.evaluate()
            count += 1
    return count
