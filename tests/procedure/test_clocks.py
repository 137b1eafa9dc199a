"""Set-up of clocks before the cycle, with simulated clocks."""

from __future__ import annotations

import pytest

from catenary.errors import ClockError
from catenary.procedure.clocks import (
    align,
    compensate,
    distribute,
    lead,
    measure,
    read_system_time,
)
from catenary.procedure.exchange import Reply, Request
from catenary.wire.datagram import EcatCommand
from tests.procedure.clock_line import HOP_NS, LONG, NONE, SHORT, STAMPS, ClockLine, ClockModel
from tests.procedure.player import ROUND_TRIP_NS, play

EPOCH_NS = 700_000_000_000_000_000


def line(*kinds: str) -> ClockLine:
    """Return a line of clocks with arbitrary origins."""
    return ClockLine(*(ClockModel(kind, zero=k * 123_456_789) for k, kind in enumerate(kinds)))


def test_the_first_device_with_a_system_time_is_the_reference() -> None:
    segment = line(NONE, STAMPS, LONG, LONG)
    measured = play(measure(segment.descriptions()), segment)
    assert measured.first == 2
    assert measured.delays_ns == (None, 0, HOP_NS, 2 * HOP_NS)
    assert [measured.runs(position) for position in range(4)] == [False, False, True, True]


def test_a_segment_without_clocks() -> None:
    segment = line(NONE, NONE)
    assert play(measure(segment.descriptions()), segment).first is None


def test_all_clocks_agree_with_the_reference() -> None:
    segment = line(LONG, SHORT, STAMPS, LONG)
    devices = segment.descriptions()
    measured = play(measure(devices), segment)
    play(align(devices, measured, 0, EPOCH_NS), segment)
    assert [clock.delay for clock in segment.clocks] == [0, HOP_NS, 0, 3 * HOP_NS]
    times = [play(read_system_time(devices[p]), segment) for p in (0, 1, 3)]
    assert times[2] == times[0] + 2000  # a microsecond per datagram
    assert times[1] == (times[0] + 1000) % 2**32
    # `play` has a separate clock, which counts round trips
    assert measured.latched_ns % ROUND_TRIP_NS == ROUND_TRIP_NS // 2


def test_a_chosen_reference() -> None:
    """Devices before the reference are not aligned: frames do not bring its time to them."""
    segment = line(LONG, LONG, LONG)
    devices = segment.descriptions()
    play(align(devices, play(measure(devices), segment), 1, EPOCH_NS), segment)
    assert [clock.delay for clock in segment.clocks] == [0, 0, HOP_NS]
    assert segment.clocks[0].offset == 0


def test_a_reference_without_a_system_time_is_refused() -> None:
    segment = line(LONG, STAMPS, NONE)
    devices = segment.descriptions()
    measured = play(measure(devices), segment)
    for position, reason in ((1, "only stamps"), (2, "has none")):
        with pytest.raises(ClockError, match=reason):
            play(align(devices, measured, position, EPOCH_NS), segment)


def test_filters_are_reset_after_offset_and_delay() -> None:
    """ESC data sheet I §9.1.4: the loop is reset after its inputs were written."""
    segment = line(LONG, LONG)
    devices = segment.descriptions()
    play(align(devices, play(measure(devices), segment), 0, EPOCH_NS), segment)
    addresses = [address for address, _ in segment.clocks[1].written if address != 0x900]
    assert addresses == [0x920, 0x928, 0x934, 0x935, 0x930]


def test_a_device_that_misses_the_latch_is_an_error() -> None:
    segment = line(LONG, LONG)

    def one_missing(request: Request) -> Reply:
        reply = segment(request)
        if request.command is EcatCommand.BWR:
            return reply._replace(working_counter=1)
        return reply

    with pytest.raises(ClockError, match="1 of 2 devices"):
        play(measure(segment.descriptions()), one_missing)


def test_a_device_lost_before_its_offset_is_written() -> None:
    segment = line(LONG, LONG)
    devices = segment.descriptions()
    measured = play(measure(devices), segment)
    segment.dead.add(1)
    with pytest.raises(Exception, match=r"device 1 \(Clock 1\): offset and delay"):
        play(align(devices, measured, 0, EPOCH_NS), segment)


def test_the_burst_has_the_given_number_of_frames() -> None:
    sent: list[Request] = []

    def count(request: Request) -> Reply:
        sent.append(request)
        return Reply(request.data, 3)

    reference = line(LONG).descriptions()[0]
    play(compensate(reference, 1300), count)
    assert sent == [distribute(reference)] * 1300
    assert all(request.alone and not request.repeatable for request in sent)


def test_each_frame_writes_our_time_to_a_following_reference() -> None:
    told: list[tuple[EcatCommand, int]] = []

    def note(request: Request) -> Reply:
        told.append((request.command, int.from_bytes(request.data, "little")))
        return Reply(request.data, 1)

    play(lead(line(LONG).descriptions()[0], 2, EPOCH_NS), note)
    times = [(EPOCH_NS + k * ROUND_TRIP_NS) % 2**32 for k in (1, 2)]
    burst = [(EcatCommand.FPWR, times[0]), (EcatCommand.FRMW, 0), (EcatCommand.FPWR, times[1])]
    assert told == [(EcatCommand.FPRD, 0), *burst, (EcatCommand.FRMW, 0)]


def test_a_burst_without_a_reference_is_an_error() -> None:
    reference = line(LONG).descriptions()[0]
    for burst in (compensate(reference), lead(reference, 15_000, 0)):
        with pytest.raises(ClockError, match="does not answer"):
            play(burst, lambda request: Reply(request.data, 0))


# A coupler, a terminal that only stamps, another terminal: ethercrab's capture replay-dc.pcapng,
# frames 501 to 525, from a real segment. Its ports 1 and 2 of the unused times say "Verl".
EK1100 = bytes.fromhex("520f623caa11623c000000005665726c")
EL2828 = bytes.fromhex("aed60b3de4d70b3d000000005665726c")
EL2889 = bytes.fromhex("ec65803c686f6666000000005665726c")
UNIT = {0x1001: "520f623cf5000000", 0x1003: "ec65803cf5000000"}


def real_segment(request: Request) -> Reply:
    station, address = request.address & 0xFFFF, request.address >> 16
    if request.command is EcatCommand.BWR:
        return Reply(request.data, 3)
    if address == 0x900:
        data = (EK1100, EL2828, EL2889)[station - 0x1001][: len(request.data)]
        return Reply(data, 1)
    if station == 0x1002:
        return Reply(request.data, 0)
    if address == 0x918:
        return Reply(bytes.fromhex(UNIT[station]), 1)
    return Reply(request.data, 1)


def test_a_real_segment_matches_the_recorded_measurement() -> None:
    devices = line(LONG, STAMPS, LONG).descriptions()
    measured = play(measure(devices), real_segment)
    # ethercrab wrote 0x91 and 0x12C to 0x0928: it ignores the delay of processing units
    assert measured.delays_ns == (0, 0x91 + 20, 0x12C + 20)
    assert measured.local_times_ns == (0xF53C620F52, None, 0xF53C8065EC)
