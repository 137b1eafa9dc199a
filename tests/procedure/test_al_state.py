"""State changes with a simulated state register."""

from __future__ import annotations

import struct

import pytest

from catenary.errors import ResponseTimeout, SegmentError, StateError
from catenary.procedure.al_state import read_state, request_state
from catenary.procedure.exchange import Reply, Request
from catenary.wire.al import AlState
from tests.procedure.player import STATION, play


class Registers:
    """Owner of AL control and AL status. `refuse` maps refused states to status codes."""

    def __init__(self, word: int = 0x01, code: int = 0) -> None:
        self.word, self.code = word, code
        self.refuse: dict[int, int] = {}
        self.slow = 0  # number of reads until a state change is visible
        self.requested: list[int] = []
        self.working_counter = 1
        self._coming: int | None = None

    def __call__(self, request: Request) -> Reply:
        address = request.address >> 16
        if address == 0x0120:
            self._ask(int.from_bytes(request.data, "little"))
            return Reply(request.data, self.working_counter)
        assert address == 0x0130
        if self._coming is not None:
            self.slow -= 1
            if self.slow < 0:
                self.word, self._coming = self._coming, None
        return Reply(struct.pack("<HHH", self.word, 0, self.code), self.working_counter)

    def _ask(self, word: int) -> None:
        self.requested.append(word)
        state, acknowledge = word & 0x0F, word & 0x10
        if self.word & 0x10 and not acknowledge:
            return  # an error must be acknowledged before anything else
        if state in self.refuse:
            self.word, self.code = (self.word & 0x0F) | 0x10, self.refuse[state]
            return
        self._coming, self.code = state, 0


def test_a_state_is_requested_once() -> None:
    device = Registers()
    device.slow = 20
    assert play(request_state(STATION, AlState.PRE_OP), device).state is AlState.PRE_OP
    assert device.requested == [0x02]


def test_a_state_that_is_reached_is_not_requested() -> None:
    device = Registers(0x02)
    play(request_state(STATION, AlState.PRE_OP), device)
    assert device.requested == []


def test_a_pending_error_is_acknowledged_first() -> None:
    device = Registers(0x12, code=0x001B)
    assert play(request_state(STATION, AlState.SAFE_OP), device).state is AlState.SAFE_OP
    assert device.requested == [0x12, 0x04]


def test_a_refusal_reports_code_text_and_cause() -> None:
    device = Registers(0x02)
    device.refuse = {0x04: 0x001E}
    with pytest.raises(StateError, match=r"Probe.*SAFE-OP.*PRE-OP.*0x001E.*nput") as caught:
        play(request_state(STATION, AlState.SAFE_OP), device)
    error = caught.value
    assert (error.position, error.requested, error.actual, error.code) == (3, 4, 2, 0x001E)
    assert error.hint


def test_a_state_that_is_never_reached_times_out() -> None:
    device = Registers(0x02)
    device.slow = 1_000_000
    with pytest.raises(StateError, match="did not reach"):
        play(request_state(STATION, AlState.SAFE_OP, timeout=0.5), device, steps=1000)


def test_an_undefined_state_is_waited_out() -> None:
    device = Registers(0x00)
    assert play(request_state(STATION, AlState.PRE_OP), device).state is AlState.PRE_OP


def test_a_missing_device_is_reported() -> None:
    device = Registers()
    device.working_counter = 0
    with pytest.raises(ResponseTimeout, match=r"Probe.*0x1004"):
        play(read_state(STATION), device)


def test_two_devices_with_one_address_are_reported() -> None:
    device = Registers()
    device.working_counter = 2
    with pytest.raises(SegmentError, match="2 devices"):
        play(read_state(STATION), device)
