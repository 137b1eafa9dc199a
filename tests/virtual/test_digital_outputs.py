"""Digital outputs: switching times with the frame and with SYNC0."""

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
    """Return the outputs of the first terminal and the update times of both, one cycle later."""
    first, last = segment[1], segment[len(segment) - 1]
    assert isinstance(first, DigitalOutputs)
    seen = []
    with cat.MainDevice(segment) as main:
        subs = main.scan()
        lamps = cat.Outputs(subs[1], subs[-1], dc=dc)
        with cat.Loop(lamps, period=PERIOD, execution="inline") as loop:
            if dc:
                loop.wait_locked()
            for cycle in loop:  # SYNC0 starts about 100 ms after activation
                taken = first.outputs_taken_ns, last.outputs_taken_ns
                if taken[0] is not None and taken[1] is not None:
                    seen.append((first.outputs, taken[0], taken[1]))
                lamps.bits[:] = cycle.number % 2
                if len(seen) == cycles:
                    return seen[1:]
    raise AssertionError("the loop ended")


def test_no_update_time_before_the_first_outputs() -> None:
    segment = line()
    with cat.MainDevice(segment) as main:
        main.scan()
        assert segment[1].outputs_taken_ns is None


def test_toml_file_can_enable_the_clock(tmp_path: Path) -> None:
    file = tmp_path / "line.toml"
    text = '[[device]]\nkind = "digital_outputs"\nbits = 2\ndc = true\ncrystal.ppm = 30.0\n'
    file.write_text(text)
    [lamp] = read_segment(file)
    assert isinstance(lamp, DigitalOutputs)
    assert (lamp.dc, lamp.crystal.ppm) == (True, 30.0)


def test_outputs_switch_with_the_frame_after_the_line_delay() -> None:
    seen = switch(line(), dc=False)
    skews = {last - first for _, first, last in seen}
    assert len(skews) == 1  # virtual lines have no jitter
    assert 1000 < skews.pop() < 10_000  # [ns] delay of six devices and their cables
    steps = {later[1] - sooner[1] for sooner, later in pairwise(seen)}
    assert steps == {1_000_000}
    assert [value for value, _, _ in seen[-4:]] in ([0, 3, 0, 3], [3, 0, 3, 0])


def test_outputs_switch_simultaneously_with_sync0() -> None:
    seen = switch(line(dc=True), dc=True)
    assert max(abs(last - first) for _, first, last in seen) < 100  # [ns] exact crystals
    assert [value for value, _, _ in seen[-4:]] in ([0, 3, 0, 3], [3, 0, 3, 0])


def test_terminal_with_an_unused_clock_switches_with_the_frame() -> None:
    seen = switch(line(dc=True), dc=False)
    assert len({last - first for _, first, last in seen}) == 1
    assert seen[-1][2] - seen[-1][1] > 1000


def test_terminal_with_a_clock_has_at_most_one_byte() -> None:
    with pytest.raises(ValueError, match="bits must be 1 to 8 with dc=True, not 16"):
        DigitalOutputs(bits=16, dc=True)
    assert DigitalOutputs(bits=8, dc=True, crystal=Crystal(ppm=20)).crystal.ppm == 20
