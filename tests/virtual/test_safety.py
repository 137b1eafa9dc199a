"""Simplified safety connections: both ends, without a segment."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.virtual import SafetyLogic, SafetyTerminal, read_segment
from catenary.virtual.fsoe import MainInstance, SafetyState, SubInstance

MS = 1_000_000
WATCHDOG = 20 * MS
DATA, RESET = SafetyState.DATA, SafetyState.RESET


class Pair:
    """A MainInstance and a SubInstance, connected by a delay of one step in each direction."""

    def __init__(self, size: int = 2, *, address: int = 7, connection_id: int = 5) -> None:
        self.main = MainInstance(size, connection_id, 7, WATCHDOG)
        self.sub = SubInstance(size, address)
        self.main.outputs = bytes(range(1, size + 1))
        self.sub.inputs = bytes(range(11, size + 11))
        self.time = 0
        self.seen: list[SafetyState] = []

    def run(self, steps: int, *, main: bytes | None = None, sub: bytes | None = None) -> None:
        """Run steps of 1 ms. `main` and `sub` replace the frames that these instances send."""
        for _ in range(steps):
            self.time += MS
            to_sub = self.main.frame if main is None else main
            to_main = self.sub.frame if sub is None else sub
            self.main.step(self.time, to_main)
            self.sub.step(self.time, to_sub)
            if self.sub.state not in self.seen[-1:]:
                self.seen.append(self.sub.state)

    @property
    def is_safe(self) -> bool:
        return not any(self.main.inputs) and not any(self.sub.outputs)

    @property
    def in_data(self) -> bool:
        return self.main.state == self.sub.state == DATA


@pytest.mark.parametrize("size", [1, 2, 4])
def test_a_connection_passes_all_states_and_carries_data(size: int) -> None:
    pair = Pair(size)
    pair.run(60)
    assert pair.seen == list(SafetyState)[pair.seen[0] :]
    assert pair.in_data
    assert pair.main.inputs == pair.sub.inputs
    assert pair.sub.outputs == pair.main.outputs
    assert pair.main.faults == pair.sub.faults == []


def test_a_pause_shorter_than_the_watchdog_only_delays() -> None:
    pair = Pair()
    pair.run(60)
    pair.run(15, main=pair.main.frame, sub=pair.sub.frame)
    pair.run(10)
    assert pair.in_data
    assert not pair.is_safe


def test_the_watchdog_leads_to_the_safe_state() -> None:
    pair = Pair()
    pair.run(60)
    pair.run(25, main=pair.main.frame, sub=pair.sub.frame)
    assert pair.is_safe
    assert (pair.main.faults, pair.sub.faults) == (["watchdog"], ["watchdog"])
    pair.run(60)
    assert pair.in_data


def test_zeros_lead_to_the_safe_state_at_once() -> None:
    pair = Pair()
    pair.run(60)
    zeros = bytes(len(pair.main.frame))
    pair.run(1, main=zeros, sub=zeros)
    assert pair.is_safe
    assert (pair.main.state, pair.sub.state) == (RESET, RESET)


@given(st.integers(0, 55))
def test_any_inverted_bit_leads_to_the_safe_state(bit: int) -> None:
    pair = Pair()
    pair.run(61)
    while pair.main.frame == (before := pair.main.frame) and pair.time % 2:
        pair.run(1)
    frame = bytearray(before)
    frame[bit // 8] ^= 1 << bit % 8
    pair.run(1, main=bytes(frame))
    assert not any(pair.sub.outputs)
    assert pair.sub.faults


def test_an_old_frame_leads_to_the_safe_state() -> None:
    pair = Pair()
    pair.run(60)
    old = pair.main.frame
    pair.run(6)
    pair.run(1, main=old)
    assert pair.sub.faults == ["CRC"]
    assert not any(pair.sub.outputs)


def test_another_safety_address_never_connects() -> None:
    pair = Pair(address=8)
    pair.run(500)
    assert pair.is_safe
    assert DATA not in pair.seen
    assert pair.sub.faults[0] == "connection ID and address (5, 7)"


def test_garbage_never_connects() -> None:
    pair = Pair()
    for k in range(300):
        pair.run(1, main=bytes((k * 7 + i * 13) & 0xFF for i in range(7)), sub=b"")
    assert pair.is_safe
    pair.run(100)
    assert pair.in_data


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SafetyLogic(connections=0), "connections must be 1 to 4, not 0"),
        (lambda: SafetyLogic(watchdog=0), "watchdog must be 1 ms to 65.535 s, not 0 s"),
        (lambda: SafetyLogic(size=3), "size must be 1, 2 or 4, not 3"),
        (lambda: SafetyTerminal(address=0), "address must be 1 to 65535, not 0"),
    ],
)
def test_impossible_options(make: type[SafetyLogic], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_reset_in_the_middle_of_a_state_begins_anew() -> None:
    for steps in range(1, 30):
        pair = Pair()
        pair.run(steps)
        pair.run(1, main=bytes(7), sub=bytes(7))
        pair.run(100)
        assert pair.in_data, steps


def test_devices_of_a_segment_file(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(
        '[[device]]\nkind = "safety_logic"\nconnections = 2\nsize = 4\nwatchdog = 0.05\n'
        '[[device]]\nkind = "safety_terminal"\naddress = 7\nsize = 1\nname = "curtain"\n'
    )
    logic, terminal = read_segment(path)
    assert isinstance(logic, SafetyLogic)
    assert (len(logic.connections), logic.size, logic.watchdog) == (2, 4, 0.05)
    assert isinstance(terminal, SafetyTerminal)
    assert (terminal.address, terminal.size, terminal.name) == (7, 1, "curtain")
