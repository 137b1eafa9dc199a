"""Devices found in SAFE-OP or OP, and detection of another master."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from catenary.procedure.exchange import Reply, Request
from catenary.procedure.live_outputs import Running, find_refreshed, find_running
from catenary.wire.al import AlState
from catenary.wire.sync_manager import INPUTS, OUTPUTS, SyncManager
from tests.procedure.player import play

DIVIDER, UNITS = 2498, 1000  # 100 ms
SYNC_MANAGERS = SyncManager(0x1100, 4, OUTPUTS).encode() + SyncManager(0x1200, 6, INPUTS).encode()
UNTRIGGERED = bytes([*SYNC_MANAGERS[:4], SYNC_MANAGERS[4] & ~0x40, *SYNC_MANAGERS[5:]])


@dataclass
class Line:
    """Registers of devices by position. `status[k]`: answers to reads of 0x0440; the last one
    repeats."""

    states: list[int]
    status: dict[int, list[int]] = field(default_factory=dict)
    time: int = UNITS
    blocks: bytes = SYNC_MANAGERS
    reads: int = 0

    def answer(self, request: Request) -> Reply:
        position = -(request.address & 0xFFFF) & 0xFFFF
        register = request.address >> 16
        size = len(request.data)
        if register == 0x0440:
            self.reads += 1
            values = self.status[position]
            value = values.pop(0) if len(values) > 1 else values[0]
        else:
            value = {
                0x0130: self.states[position],
                0x0005: 2,
                0x0400: DIVIDER,
                0x0420: self.time,
                0x0800: int.from_bytes(self.blocks, "little"),
            }[register]
        return Reply(value.to_bytes(size, "little"), 1)


def running(*positions: int, state: AlState = AlState.OP) -> list[Running]:
    return [Running(position, state, False, 2) for position in positions]


def test_devices_in_safe_op_and_op_are_found() -> None:
    line = Line([0x01, 0x08, 0x14, 0x02])
    assert play(find_running(4), line.answer) == [
        Running(1, AlState.OP, False, 2),
        Running(2, AlState.SAFE_OP, True, 2),
    ]


def test_a_silent_device_is_omitted() -> None:
    assert play(find_running(1), lambda request: Reply(request.data, 0)) == []


def test_outputs_of_a_killed_master_expire() -> None:
    line = Line([0x08], {0: [1, 1, 1, 0]})
    assert play(find_refreshed(running(0)), line.answer) == []
    assert line.reads == 4


def test_outputs_of_a_live_master_do_not_expire() -> None:
    line = Line([0x08, 0x08], {0: [1, 0], 1: [1]})
    assert play(find_refreshed(running(0, 1)), line.answer) == [1]
    assert 20 <= line.reads <= 25  # twice 100 ms, in steps of 10 ms


@pytest.mark.parametrize(
    "line",
    [
        Line([0x08], {0: [1]}, time=0),
        Line([0x08], {0: [1]}, blocks=UNTRIGGERED),
        Line([0x08], {0: [1]}, time=60_000),
    ],
    ids=["watchdog off", "not triggered by outputs", "too long to wait for"],
)
def test_a_device_without_a_watchdog_is_not_checked(line: Line) -> None:
    assert play(find_refreshed(running(0)), line.answer) == []
    assert line.reads == 0


def test_devices_in_safe_op_are_not_checked() -> None:
    line = Line([0x04], {0: [1]})
    assert play(find_refreshed(running(0, state=AlState.SAFE_OP)), line.answer) == []
    assert line.reads == 0
