"""Sinks: called once per cycle in the post-processing, with inputs and outputs."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from catenary.core import RECORD_FIELDS
from tests.core.rig import CSP, Bench, ScriptedDrive, axis, make_plan
from tests.core.sink_table import PUT, Table
from tests.link_table import capsule_of

NAME = b"catenary.sink"


class Sink:
    """Keeps what it is given."""

    def __init__(self, b: Bench, look: Callable[[], int] = lambda: 0) -> None:
        self.engine = b.engine
        self.look = look
        self.given: list[tuple[int, np.void, np.ndarray, np.ndarray, int]] = []
        self.table = Table(2, *b.engine.sink_sizes, None, PUT(self.put))
        self.capsule = capsule_of(self.table, NAME)

    def put(self, _, number, record, actual, target) -> None:
        sizes = self.engine.sink_sizes
        blocks = [
            np.frombuffer(ctypes.string_at(where, size), np.uint8)
            for where, size in zip((record, actual, target), sizes, strict=True)
        ]
        told = blocks[0].view(np.dtype(RECORD_FIELDS))[0]
        self.given.append((number, told, blocks[1], blocks[2], self.look()))

    def field(self, name: str, block: int) -> np.ndarray:
        """All that was given of it."""
        offset, code, count = self.engine.sink_fields()[block][name]
        size = np.dtype(code).itemsize * (count or 1)
        return np.array([each[2 + block][offset : offset + size].view(code) for each in self.given])


def opened(execution: str, **options: object) -> tuple[Bench, Sink]:
    b = Bench(
        make_plan([axis(0), axis(1)], execution=execution), [ScriptedDrive(), ScriptedDrive()]
    )
    b.engine.stop()
    sink = Sink(b, **options)  # type: ignore[arg-type]
    b.engine.set_sink(sink.capsule)
    b.engine.start()
    return b, sink


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_every_cycle_once_with_what_was_known_and_sent(execution: str) -> None:
    b, sink = opened(execution)
    b.enable()
    for k in range(10):
        b.target_position[:] = b.actual_position + 0.001 * k
        b.engine.next()
    numbers = [number for number, *_ in sink.given]
    assert numbers == list(range(1, len(numbers) + 1))
    assert numbers == [told["number"] for _, told, *_ in sink.given]
    assert (np.diff([told["scheduled_ns"] for _, told, *_ in sink.given]) == 1_000_000).all()
    if execution != "inline":  # there the tail of the newest cycle comes behind the next body
        assert sink.field("position", 0)[-1] == pytest.approx(b.actual_position)
    assert len(sink.given) == b.engine.number - (execution == "inline")
    commanded = sink.field("commanded_position", 0)
    assert commanded[-1] == pytest.approx([d.target_position / 1000 for d in b.drives], abs=1e-3)
    assert (sink.field("target_mode", 1) == CSP).all()


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_the_sink_is_called_after_the_frames_of_its_cycle(execution: str) -> None:
    sent: list[int] = []
    b, sink = opened(execution, look=lambda: len(sent))
    b.link.sent = sent
    b.steps(5)
    frames = [each[4] for each in sink.given]
    assert frames == sorted(set(frames))  # one more each time
    assert frames[-1] == len(sent)


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_the_controlword_is_that_of_the_frames_of_its_cycle(execution: str) -> None:
    on_the_wire: list[list[int]] = []

    def look() -> int:
        on_the_wire.append([drive.controlword for drive in b.drives])
        return 0

    b, sink = opened(execution, look=look)
    b.enable()
    b.steps(3)
    b.controlword_bits[0] = 0x0010  # of the mode, in OPERATION_ENABLED
    b.steps(3)
    b.ask(2)
    b.steps(3)
    assert sink.field("controlword", 0).tolist() == on_the_wire
    words = [words[0] for words in on_the_wire]
    assert {0x06, 0x07, 0x0F, 0x1F, 0x02} <= set(words)
    assert on_the_wire[words.index(0x1F)] == [0x1F, 0x0F]


def test_an_inline_cycle_has_its_own_commands_and_not_those_before() -> None:
    b, sink = opened("inline")
    b.enable()
    b.target_position[:] = 0.25
    b.engine.next()
    assert sink.field("commanded_position", 0)[-1] == pytest.approx(0.25)
    assert sink.given[-1][1]["process_ns"] >= 0


def test_nothing_is_given_when_it_is_taken_away() -> None:
    b, sink = opened("threaded")
    b.steps(3)
    b.engine.stop()
    count = len(sink.given)
    b.engine.set_sink(None)
    b.engine.start()
    b.steps(3)
    assert len(sink.given) == count > 0


def test_refuses_a_table_of_another_version_or_of_other_blocks() -> None:
    b, sink = opened("threaded")
    with pytest.raises(RuntimeError, match="is running"):
        b.engine.set_sink(None)
    b.engine.stop()
    sink.table.actual_size += 8
    with pytest.raises(ValueError, match=r"sink: blocks of .* bytes, the engine has"):
        b.engine.set_sink(sink.capsule)
    sink.table.version = 1
    with pytest.raises(ValueError, match="version 1, expected 2"):
        b.engine.set_sink(sink.capsule)
    other = b"catenary.link"
    with pytest.raises(ValueError, match="incorrect name"):
        b.engine.set_sink(capsule_of(sink.table, other))


def test_the_fields_lie_in_their_blocks() -> None:
    b, _ = opened("threaded")
    _, actual_size, target_size = b.engine.sink_sizes
    for fields, size in zip(b.engine.sink_fields(), (actual_size, target_size), strict=True):
        for offset, code, count in fields.values():
            width = np.dtype(code).itemsize
            assert offset % width == 0
            assert offset + width * (1 if count is None else count) <= size
