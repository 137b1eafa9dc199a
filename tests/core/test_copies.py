"""Copies between devices: inputs of a cycle are sent as outputs in the next one.

Device 0 is the source and device 1 the destination, each in its own sync unit.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from catenary.core import Engine
from catenary.plan.cycle import ImageCopy
from tests.core.rig import DRIVE_SIZE as SIZE
from tests.core.rig import Bench, ScriptedDrive, axis, make_plan
from tests.core.test_law import Frame, make_law

EXECUTIONS = ("threaded", "inline")


def copy(input_bit: int, output_bit: int, bits: int) -> ImageCopy:
    return ImageCopy("a to b", input_bit, output_bit, bits, 1, 1)


class Source(ScriptedDrive):
    """Device with one input: the number of frames that it has processed."""

    count = 0

    def exchange(self, outputs: bytes) -> bytes:
        self.count += 1
        return bytes((self.count % 256, 0xA5, 0x0F)) + bytes(SIZE - 3)


class Destination(ScriptedDrive):
    """Device that records its outputs."""

    def __init__(self) -> None:
        super().__init__()
        self.received: list[bytes] = []

    def exchange(self, outputs: bytes) -> bytes:
        self.received.append(outputs)
        return bytes(SIZE)

    @property
    def first(self) -> list[int]:
        return [outputs[0] for outputs in self.received]


def pair(*copies: ImageCopy, execution: str = "threaded") -> tuple[Bench, Source, Destination]:
    plan = replace(make_plan([], units=2, execution=execution), copies=copies)
    source, destination = Source(), Destination()
    return Bench(plan, [source, destination]), source, destination


BYTE = copy(0, 8 * SIZE, 8)


@pytest.mark.parametrize("execution", EXECUTIONS)
def test_inputs_of_a_cycle_are_sent_in_the_next_cycle(execution: str) -> None:
    b, source, destination = pair(BYTE, execution=execution)
    b.steps(5)
    assert source.count == 5
    assert destination.first == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("execution", EXECUTIONS)
def test_a_law_does_not_change_the_latency(execution: str) -> None:
    plan = make_plan([axis(2)], units=3, execution=execution)
    source, destination = Source(), Destination()
    b = Bench(replace(plan, copies=(BYTE,)), [source, destination, ScriptedDrive()])

    def nothing(frame: Frame) -> int:
        return 0

    b.engine.start_law(make_law(b, nothing))
    b.steps(6)
    b.engine.stop_law()
    b.steps(4)
    assert destination.first == list(range(source.count))


@pytest.mark.parametrize("execution", EXECUTIONS)
def test_a_lost_frame_repeats_the_last_inputs(execution: str) -> None:
    b, source, destination = pair(BYTE, execution=execution)
    b.steps(3)
    b.segment.spoil = lambda frame: []
    b.steps(2)
    b.segment.spoil = None
    b.steps(2)
    # The devices have processed the frames that were lost on their way back.
    assert destination.first == [0, 1, 2, 3, 3, 3, 6]
    assert source.count == 7


def test_a_source_with_a_wrong_working_counter_repeats_its_last_inputs() -> None:
    b, _, destination = pair(BYTE)
    b.steps(3)
    b.segment.silent.add(0)
    b.steps(3)
    b.segment.silent.clear()
    b.steps(2)
    assert destination.first == [0, 1, 2, 3, 3, 3, 3, 4]


def test_zeros_are_sent_before_the_first_valid_inputs() -> None:
    b, _, destination = pair(BYTE)
    b.segment.silent.add(0)
    b.steps(3)
    b.segment.silent.clear()
    b.steps(2)
    assert destination.first == [0, 0, 0, 0, 1]


@pytest.mark.parametrize("execution", EXECUTIONS)
def test_copies_go_on_in_a_hand_over_and_end_with_zeros(execution: str) -> None:
    b, _, destination = pair(BYTE, execution=execution)
    b.engine.run(4)
    b.engine.quick_stop_all()
    b.engine.run(2)
    b.engine.end_copies()
    b.engine.run(2)
    assert destination.first == [0, 1, 2, 3, 4, 5, 0, 0]


def test_after_a_law_one_more_frame_has_the_copies() -> None:
    """A law prepares the outputs of the next cycle, so the zeros follow one cycle later."""
    b, _, destination = pair(BYTE)

    def nothing(frame: Frame) -> int:
        return 0

    b.engine.start_law(make_law(b, nothing))
    b.steps(4)
    b.engine.stop_law()
    b.engine.end_copies()
    b.steps(3)
    assert destination.first == [0, 1, 2, 3, 4, 0, 0]


def test_neighbours_of_copied_bytes_and_bits_do_not_change() -> None:
    at = 8 * SIZE
    bits, odd = copy(8 + 2, at + 8 * 3 + 1, 5), copy(8 + 3, at + 8 * 5 + 7, 12)
    b, _, destination = pair(copy(8, at + 8, 16), bits, odd)
    b.steps(2)
    inputs = 1 | 0xA5 << 8 | 0x0F << 16
    expected = 0
    for each in b.plan.copies:
        value = inputs >> each.input_bit & ((1 << each.bit_length) - 1)
        expected |= value << each.output_bit - at
    assert int.from_bytes(destination.received[-1], "little") == expected
    b.engine.end_copies()
    b.steps(1)
    assert not any(destination.received[-1])


def test_one_source_has_several_destinations() -> None:
    at = 8 * SIZE
    b, _, destination = pair(copy(0, at, 8), copy(0, at + 16, 8))
    b.steps(4)
    assert destination.received[-1][:3] == b"\x03\x00\x03"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (copy(0, 16 * SIZE, 8), r"copy a to b: bits 208 to 215 exceed the image of 26 bytes"),
        (copy(-8, 0, 8), "exceed the image"),
        (copy(16 * SIZE - 7, 0, 8), "exceed the image"),
        (copy(0, 0, 0), "exceed the image"),
        (copy(1, 0, 65), "65 bits that are not whole bytes"),
    ],
)
def test_an_impossible_copy_is_refused(wrong: ImageCopy, message: str) -> None:
    plan = replace(make_plan([], units=2), copies=(wrong,))
    with pytest.raises(ValueError, match=message):
        Bench(plan)


def test_an_engine_without_copies_accepts_their_end() -> None:
    b = Bench(make_plan([], units=1))
    assert isinstance(b.engine, Engine)
    b.engine.end_copies()
    b.steps(1)
