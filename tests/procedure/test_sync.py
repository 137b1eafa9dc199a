"""SYNC signals of simulated clocks."""

from __future__ import annotations

import pytest

from catenary.errors import CatenaryError, ClockError
from catenary.plan.clocks import SyncPlan
from catenary.procedure.clocks import align, measure
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.sync import bring_together, start, stop
from catenary.wire.datagram import EcatCommand
from tests.procedure.clock_line import LONG, NONE, SHORT, ClockLine, ClockModel
from tests.procedure.player import play

PERIOD_NS = 1_000_000
SYNC0 = SyncPlan(0x0300, PERIOD_NS, 0, 0)
SHIFTED = SyncPlan(0x0700, PERIOD_NS, 20_000, -50_000)


def aligned(*kinds: str) -> ClockLine:
    segment = ClockLine(*(ClockModel(kind, zero=k * 987_654_321) for k, kind in enumerate(kinds)))
    devices = segment.descriptions()
    play(align(devices, play(measure(devices), segment), 0, 0), segment)
    return segment


def number(segment: ClockLine, position: int, address: int, size: int) -> int:
    registers = segment.clocks[position].registers
    return int.from_bytes(registers[address : address + size], "little")


def test_all_devices_get_one_start_time_plus_their_shift() -> None:
    segment = aligned(LONG, NONE, LONG, SHORT)
    devices = segment.descriptions()
    syncs = {2: SYNC0, 3: SHIFTED}
    beat = play(start(devices, syncs, devices[0], 0), segment)
    assert beat % PERIOD_NS == 0
    assert number(segment, 2, 0x0990, 8) == beat
    assert number(segment, 3, 0x0990, 4) == (beat - 50_000) % 2**32  # of a 32-bit clock
    assert number(segment, 2, 0x09A0, 4) == PERIOD_NS
    assert number(segment, 3, 0x09A4, 4) == 20_000
    assert number(segment, 2, 0x0980, 2) == 0x0300
    assert number(segment, 3, 0x0980, 2) == 0x0700


def test_the_order_is_stop_cycle_start_time_activation() -> None:
    """ETG.1020: the start time is written while the unit is off, and counts from activation on."""
    segment = aligned(LONG, LONG)
    devices = segment.descriptions()
    segment.clocks[1].written.clear()
    play(start(devices, {1: SYNC0}, devices[0], 0), segment)
    assert [address for address, _ in segment.clocks[1].written] == [0x981, 0x9A0, 0x990, 0x980]


def test_complete_clock_set_up() -> None:
    segment = ClockLine(ClockModel(LONG), ClockModel(LONG, zero=12345))
    measured = play(bring_together(segment.descriptions(), {1: SYNC0}, 0, 0, burst=10), segment)
    assert measured.first == 0
    assert number(segment, 1, 0x0980, 2) == 0x0300


def test_a_start_time_written_too_late_is_an_error() -> None:
    segment = aligned(LONG, LONG)
    devices = segment.descriptions()

    def slow(request: Request) -> Reply:
        if request.command is EcatCommand.FPWR and request.address >> 16 == 0x0990:
            segment.now += 200_000_000
        return segment(request)

    with pytest.raises(ClockError, match=r"in 3 attempts, writing took longer than 1[0-9]+ ms"):
        play(start(devices, {1: SYNC0}, devices[0], 0), slow)


def test_a_lost_device_is_an_error() -> None:
    segment = aligned(LONG, LONG)
    devices = segment.descriptions()
    segment.dead.add(1)
    with pytest.raises(CatenaryError, match=r"device 1 \(Clock 1\): its SYNC unit"):
        play(start(devices, {1: SYNC0}, devices[0], 0), segment)


def test_stop() -> None:
    segment = aligned(LONG, LONG)
    devices = segment.descriptions()
    play(start(devices, {1: SYNC0}, devices[0], 0), segment)
    play(stop(devices), segment)
    assert number(segment, 1, 0x0981, 1) == 0
    assert play(stop([]), segment) is None
