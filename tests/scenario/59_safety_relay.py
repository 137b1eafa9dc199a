"""The cycle relays the frames of two safety connections, which start up while a drive moves.
Frames are lost, the logic is off, two devices are exchanged, or the loop ends. Each time the
safety devices themselves go to their safe state; the relay takes no decision.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

import catenary as cat
from catenary.link import FaultInjector
from catenary.virtual import Coupler, SafetyLogic, SafetyTerminal, Segment, Servo
from catenary.virtual.fsoe import SafetyState
from tests.scenario.cell import Cell

FIRST, SECOND, SERVO, LOGIC = 1, 2, 3, 4
DATA, RESET = SafetyState.DATA, SafetyState.RESET
WATCHDOG = 0.02
ZEROS = bytes(2)
STOP = cat.StopPolicy(lost_limit=1000)


@dataclass
class Line:
    cell: Cell
    logic: SafetyLogic
    terminals: list[SafetyTerminal]

    def connection(self, number: int, terminal: int) -> cat.FsoeConnection:
        """Connect connection `number` (from 1) of the logic to a terminal."""
        return cat.FsoeConnection(
            main=(self.cell.subs[LOGIC], f"FSoE main frame {number}", f"FSoE sub frame {number}"),
            sub=(self.cell.subs[terminal], "FSoE sub frame", "FSoE main frame"),
        )

    def relay(self, *terminals: int) -> cat.Copies:
        chosen = terminals or (FIRST, SECOND)
        connections = [self.connection(k, each) for k, each in enumerate(chosen, 1)]
        optional = [self.cell.subs[k] for k in (FIRST, SECOND, LOGIC)]
        return cat.Copies(*connections, optional=optional)

    @property
    def states(self) -> list[SafetyState]:
        return [*self.logic.states, *(each.connection.state for each in self.terminals)]

    @property
    def outputs(self) -> list[bytes]:
        """Safe outputs of the terminals: the logic sends their safe inputs back."""
        return [each.safe_outputs for each in self.terminals]

    def press(self) -> list[bytes]:
        for number, each in enumerate(self.terminals, 1):
            each.safe_inputs = bytes((number, 0xA0 + number))
        return [each.safe_inputs for each in self.terminals]


@pytest.fixture
def line() -> Iterator[Line]:
    logic = SafetyLogic(connections=2, watchdog=WATCHDOG)
    terminals = [SafetyTerminal(address=1), SafetyTerminal(address=2, serial=2)]
    segment = Segment([Coupler(), *terminals, Servo(), logic])
    link = FaultInjector(segment)
    with cat.MainDevice(link) as main:
        main.scan()
        yield Line(Cell(segment, link, main), logic, terminals)


@cat.law
def swing(actual, target, memory, time):  # type: ignore[no-untyped-def]
    for i in range(actual.n):
        target.position[i] = memory[i] + 0.1 * time


def run(loop: cat.Loop, seconds: float) -> None:
    loop.run_for(seconds)


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_sessions_start_and_carry_data_while_a_drive_moves(line: Line, execution: str) -> None:
    pressed, arm, relay = line.press(), line.cell.drives(), line.relay()
    with cat.Loop(arm, relay, execution=execution) as loop:
        move = arm.move_by(0.3)
        run(loop, 0.2)
        assert line.states == [DATA] * 4
        assert line.outputs == pressed
        assert [frames.main[-2:] for frames in relay.fsoe_frames] == [b"\1\0", b"\2\0"]
        assert relay.fsoe_problems == ()
        loop.wait(move)
        assert line.states == [DATA] * 4
        assert line.logic.connections[0].faults == []
        assert loop.timing.counters["lost"] == 0
    line.cell.assert_safe()


def test_a_session_goes_on_while_a_law_moves_the_drive(line: Line) -> None:
    pressed, arm = line.press(), line.cell.drives()
    with cat.Loop(arm, line.relay()) as loop:
        run(loop, 0.1)

        law = loop.start(swing, memory=arm.actual.position)
        run(loop, 0.2)
        assert law.running
        assert line.states == [DATA] * 4
        assert line.outputs == pressed
        line.terminals[0].safe_inputs = b"\x77\x88"
        run(loop, 0.1)
        assert line.outputs[0] == b"\x77\x88"


def test_a_few_lost_frames_only_delay_the_data(line: Line) -> None:
    pressed = line.press()
    with cat.Loop(line.relay(), stop=STOP) as loop:
        run(loop, 0.1)
        line.cell.spoil("lose", 5)
        run(loop, 0.05)
        assert line.states == [DATA] * 4
        assert line.outputs == pressed
        assert not any(main.faults for main in line.logic.connections)


def test_frames_lost_for_longer_than_the_watchdog_end_in_the_safe_state(line: Line) -> None:
    pressed = line.press()
    with cat.Loop(line.relay(), stop=STOP) as loop:
        run(loop, 0.1)
        line.cell.spoil("lose", 40)
        run(loop, 0.035)
        assert line.outputs == [ZEROS, ZEROS]
        assert line.states == [RESET] * 4
        assert {each.connection.faults[0] for each in line.terminals} == {"watchdog"}
        run(loop, 0.2)
        assert line.states == [DATA] * 4  # the devices begin a new session
        assert line.outputs == pressed


def test_the_logic_without_power_ends_in_the_safe_state(line: Line) -> None:
    pressed, arm = line.press(), line.cell.drives()
    with cat.Loop(arm, line.relay()) as loop:
        run(loop, 0.1)
        assert line.outputs == pressed
        line.logic.power_off()
        run(loop, 0.05)
        assert line.outputs == [ZEROS, ZEROS]
        assert line.cell.drive_states == ["OPERATION ENABLED"]  # the loop goes on
        line.logic.power_on()
        run(loop, 2.0)
        assert line.states == [DATA] * 4
        assert line.outputs == pressed


def test_the_end_of_the_loop_ends_in_the_safe_state(line: Line) -> None:
    pressed = line.press()
    with cat.Loop(line.relay()) as loop:
        run(loop, 0.1)
        assert line.outputs == pressed
    assert line.outputs == [ZEROS, ZEROS]
    # The zeros of the relay arrive before the watchdog expires.
    faults = [each.connection.faults for each in line.terminals]
    assert faults == [["connection ID 0, not 1"], ["connection ID 0, not 2"]]
    line.cell.assert_safe()


def test_a_relay_with_exchanged_terminals_never_leaves_the_safe_state(line: Line) -> None:
    line.press()
    relay = line.relay(SECOND, FIRST)
    with cat.Loop(relay) as loop:
        run(loop, 0.5)
        assert line.outputs == [ZEROS, ZEROS]
        assert DATA not in line.states
        assert any("connection ID" in fault for fault in line.terminals[0].connection.faults)


def test_a_relay_with_crossed_answers_never_leaves_the_safe_state(line: Line) -> None:
    """The frames to the logic are exchanged, but not those from it."""
    subs = line.cell.subs
    line.press()
    crossed = [
        cat.FsoeConnection(
            main=(subs[LOGIC], f"FSoE main frame {k}", f"FSoE sub frame {3 - k}"),
            sub=(subs[SECOND - 2 + k], "FSoE sub frame", "FSoE main frame"),
        )
        for k in (1, 2)
    ]
    with cat.Loop(cat.Copies(*crossed)) as loop:
        for cycle in loop:
            assert line.outputs == [ZEROS, ZEROS]
            assert DATA not in line.states
            if cycle.time > 0.5:
                break
    assert all(main.faults for main in line.logic.connections)
