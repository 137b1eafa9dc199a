"""The cycle copies inputs of one device to the outputs of another one. The source leaves OP, loses
its power and returns; frames are lost; the axes are stopped; the loop ends. The destination gets
the last valid values, and zeros at the end.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, StateError
from catenary.link import FaultInjector
from catenary.virtual import Coupler, DigitalInputs, DigitalOutputs, Segment, Servo
from catenary.virtual.faults import cut
from tests.scenario.cell import PRE_OP, SAFE_OP, Cell

LAMPS, SERVO, BUTTONS = 1, 2, 3


@cat.law
def stay(actual, target, memory, time):  # type: ignore[no-untyped-def]
    for i in range(actual.n):
        target.position[i] = target.position[i]


@dataclass
class Line:
    cell: Cell
    buttons: DigitalInputs
    lamps: DigitalOutputs

    def copies(self, *optional: int) -> cat.Copies:
        """Copy button 2 to lamp 1, and buttons 3 and 4 to lamps 7 and 8."""
        subs = self.cell.subs
        return cat.Copies(
            cat.Copy(subs[BUTTONS], "0x6010:01", subs[LAMPS], (0x7000, 1)),
            cat.Copy(subs[BUTTONS], 0x1A02, subs[LAMPS], "Channel 7"),
            cat.Copy(subs[BUTTONS], 0x1A03, subs[LAMPS], "Channel 8"),
            optional=[subs[each] for each in optional],
        )


@pytest.fixture
def line() -> Iterator[Line]:
    buttons, lamps = DigitalInputs(bits=4), DigitalOutputs(bits=8)
    segment = Segment([Coupler(), lamps, Servo(), buttons])
    link = FaultInjector(segment)
    with cat.MainDevice(link) as main:
        main.scan()
        yield Line(Cell(segment, link, main), buttons, lamps)


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_bits_are_copied_with_one_cycle_of_delay(line: Line, execution: str) -> None:
    with cat.Loop(line.copies(), execution=execution) as loop:
        loop.run_for(0.01)
        assert line.lamps.outputs == 0
        line.buttons.inputs = 0b1110
        loop.run_for(0.01)
        assert line.lamps.outputs == 0b1100_0001
        line.buttons.inputs = 0b0101
        loop.run_for(0.01)
        assert line.lamps.outputs == 0b0100_0000


def test_a_required_source_that_leaves_op_ends_the_loop(line: Line) -> None:
    with pytest.raises(StateError) as caught, cat.Loop(line.copies()) as loop:
        line.buttons.inputs = 0b1111
        loop.run_for(0.1)
        line.cell.segment.core.show_al_status(BUTTONS, SAFE_OP | 0x10, 0x1B)
        loop.run_for(0.1)
    assert caught.value.position == BUTTONS
    assert line.lamps.outputs == 0


def test_a_source_without_power_keeps_its_last_value_and_returns(line: Line) -> None:
    arm = line.cell.drives()
    with cat.Loop(arm, line.copies(BUTTONS)) as loop:
        line.buttons.inputs = 0b0010
        loop.run_for(0.1)
        assert line.lamps.outputs == 1
        line.buttons.power_off()
        loop.run_for(0.2)
        assert line.lamps.outputs == 1
        assert line.cell.drive_states == ["OPERATION ENABLED"]
        line.buttons.power_on()
        loop.run_for(2.0)
        line.buttons.inputs = 0b1000
        loop.run_for(0.1)
        assert line.lamps.outputs == 0b1000_0000


def test_lost_frames_keep_the_last_value(line: Line) -> None:
    with cat.Loop(line.copies(), stop=cat.StopPolicy(lost_limit=100)) as loop:
        line.buttons.inputs = 0b0010
        loop.run_for(0.01)
        line.cell.spoil("lose", 20)
        line.buttons.inputs = 0
        loop.run_for(0.015)
        assert line.lamps.outputs == 1
        loop.run_for(0.02)
        assert line.lamps.outputs == 0


def test_copies_go_on_while_the_axes_are_stopped_and_end_as_zeros(line: Line) -> None:
    arm = line.cell.drives()
    with cat.Loop(arm, line.copies()) as loop:
        line.buttons.inputs = 0b0010
        loop.run_for(0.01)
        arm.quick_stop()
        loop.run_for(0.1)
        assert line.cell.drive_states != ["OPERATION ENABLED"]
        line.buttons.inputs = 0b1000
        loop.run_for(0.01)
        assert line.lamps.outputs == 0b1000_0000
    # The lamps keep their memory: it has what the last frames of the loop contained.
    assert line.lamps.core.output_image(LAMPS, 0) == b"\0"
    assert line.cell.states[LAMPS] == PRE_OP
    line.cell.assert_safe()


@pytest.mark.parametrize("execution", ["threaded", "inline"])
@pytest.mark.parametrize("reason", [ValueError, KeyboardInterrupt, SystemExit])
def test_every_end_of_the_loop_sends_zeros(
    line: Line, execution: str, reason: type[BaseException]
) -> None:
    signals = {KeyboardInterrupt: signal.SIGINT, SystemExit: signal.SIGTERM}
    with pytest.raises(reason), cat.Loop(line.copies(), execution=execution) as loop:
        line.buttons.inputs = 0b1110
        loop.run_for(0.01)
        assert line.lamps.outputs == 0b1100_0001
        if reason in signals:
            os.kill(os.getpid(), signals[reason])
            loop.run_for(1.0)
        raise ValueError
    assert line.lamps.core.output_image(LAMPS, 0) == b"\0"


def test_zeros_follow_while_a_law_runs(line: Line) -> None:
    with cat.Loop(line.cell.drives(), line.copies()) as loop:
        line.buttons.inputs = 0b0010
        loop.start(stay)
        loop.run_for(0.01)
        assert line.lamps.outputs == 1
    assert line.lamps.core.output_image(LAMPS, 0) == b"\0"


def test_the_program_reads_the_source_too(line: Line) -> None:
    buttons = cat.Inputs(line.cell.subs[BUTTONS])
    with cat.Loop(line.copies(), buttons) as loop:
        line.buttons.inputs = 0b0010
        loop.run_for(0.01)
        assert line.lamps.outputs == 1
        assert list(buttons.bits) == [0, 1, 0, 0]


def test_a_divided_destination_receives_every_nth_value(line: Line) -> None:
    divided = cat.ProcessData(line.cell.subs[LAMPS], outputs={}, divider=4)
    received = []
    with cat.Loop(line.copies(), divided) as loop:
        for number in range(40):
            line.buttons.inputs = 0b0010 * (number % 2)
            next(loop)
            received.append(line.lamps.outputs)
    changes = sum(a != b for a, b in pairwise(received))
    assert changes <= 40 // 4
    assert line.lamps.core.output_image(LAMPS, 0) == b"\0"


def test_a_ring_is_cut_while_bits_are_copied() -> None:
    buttons, lamps = DigitalInputs(), DigitalOutputs()
    segment = Segment([Coupler(), lamps, Servo(), buttons], ring=True)
    with cat.MainDevice(segment.first, segment.second) as main:
        subs = main.scan()
        copies = cat.Copies(cat.Copy(subs[BUTTONS], "Channel 1", subs[LAMPS], "Channel 4"))
        with cat.Loop(copies, stop=cat.StopPolicy(lost_limit=20)) as loop:
            for number in range(4):
                if number == 2:
                    segment.inject(cut(between=(LAMPS, SERVO), at=0))
                buttons.inputs = number % 2
                loop.run_for(0.05)
                assert lamps.outputs == 8 * (number % 2)


def test_a_source_in_safe_op_is_still_copied(line: Line) -> None:
    """Its inputs are valid in SAFE-OP. The loop goes on, because it is optional."""
    policy = cat.StopPolicy(on_return="hold")
    with cat.Loop(line.copies(BUTTONS), stop=policy) as loop:
        loop.run_for(0.1)
        line.cell.segment.core.show_al_status(BUTTONS, SAFE_OP | 0x10, 0x1B)
        line.buttons.inputs = 0b0010
        loop.run_for(0.1)
        assert line.lamps.outputs == 1


def test_the_program_cannot_write_the_destination(line: Line) -> None:
    outputs = cat.Outputs(line.cell.subs[LAMPS])
    with pytest.raises(ConfigurationError, match="two requests write byte 0 of its outputs") as e:
        cat.Loop(line.copies(), outputs).__enter__()
    assert "0x6010:01" in str(e.value)
    assert "Outputs(1" in str(e.value)
