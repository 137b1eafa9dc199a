"""Digital outputs: when they switch, with the frame and with SYNC0."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

import catenary as cat
from catenary.virtual import Coupler, Crystal, DigitalOutputs, Segment, Servo, read_segment

PERIOD = 1e-3


def line(**options: bool) -> Segment:
    ends = [DigitalOutputs(bits=2, serial=k, **options) for k in (1, 2)]
    return Segment([Coupler(), ends[0], *(Servo() for _ in range(5)), ends[1]])


def switch(segment: Segment, *, dc: bool, cycles: int = 20) -> list[tuple[int, int, int]]:
    """What stood at the first one's terminals, and when both took over, seen a cycle later."""
    first, last = segment[1], segment[len(segment) - 1]
    assert isinstance(first, DigitalOutputs)
    seen = []
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        lamps = cat.Outputs(subs[1], subs[-1], dc=dc)
        with cat.Loop(lamps, period=PERIOD, execution="inline") as loop:
            if dc:
                loop.wait_locked()
            for cycle in loop:  # SYNC0 begins some 100 ms after it was switched on
                taken = first.outputs_taken_ns, last.outputs_taken_ns
                if taken[0] is not None and taken[1] is not None:
                    seen.append((first.outputs, taken[0], taken[1]))
                lamps.bits[:] = cycle.number % 2
                if len(seen) == cycles:
                    return seen[1:]
    raise AssertionError("the loop ended")


def test_not_before_outputs_came() -> None:
    segment = line()
    with cat.MainDevice(segment) as main:
        main.scan()
        assert segment[1].outputs_taken_ns is None


def test_a_file_can_ask_for_the_clock(tmp_path: Path) -> None:
    file = tmp_path / "line.toml"
    text = '[[device]]\nkind = "digital_outputs"\nbits = 2\ndc = true\ncrystal.ppm = 30.0\n'
    file.write_text(text)
    [lamp] = read_segment(file)
    assert isinstance(lamp, DigitalOutputs)
    assert (lamp.dc, lamp.crystal.ppm) == (True, 30.0)


def test_with_the_frame_the_last_one_switches_later_by_the_line() -> None:
    seen = switch(line(), dc=False)
    skews = {last - first for _, first, last in seen}
    assert len(skews) == 1  # virtual lines do not scatter
    assert 1000 < skews.pop() < 10_000  # [ns] through six devices and their cables
    steps = {later[1] - sooner[1] for sooner, later in pairwise(seen)}
    assert steps == {1_000_000}
    assert [value for value, _, _ in seen[-4:]] in ([0, 3, 0, 3], [3, 0, 3, 0])


def test_with_sync0_all_switch_at_once() -> None:
    seen = switch(line(dc=True), dc=True)
    assert max(abs(last - first) for _, first, last in seen) < 100  # [ns] exact crystals
    assert [value for value, _, _ in seen[-4:]] in ([0, 3, 0, 3], [3, 0, 3, 0])


def test_a_terminal_with_a_clock_that_is_not_used_switches_with_the_frame() -> None:
    seen = switch(line(dc=True), dc=False)
    assert len({last - first for _, first, last in seen}) == 1
    assert seen[-1][2] - seen[-1][1] > 1000


def test_a_clock_is_for_one_byte() -> None:
    with pytest.raises(ValueError, match="bits must be 1 to 8 with dc=True, not 16"):
        DigitalOutputs(bits=16, dc=True)
    assert DigitalOutputs(bits=8, dc=True, crystal=Crystal(ppm=20)).crystal.ppm == 20
