"""The table of frames' intervals: what is taken from a capture, and a run as short as can be."""

from __future__ import annotations

import json

import pytest

from benchmarks.tables import rteml
from benchmarks.tables.rteml import Capture, Stretch
from benchmarks.tables.sheet import Options, as_json, show
from catenary.bench.rounds import RoundError
from tests.benchmarks.patience import patiently

STRETCH = Stretch(start_ns=1000, end_ns=5000, cycles=4, lost=1, scheduling="")


def frame(index: int, size: int = 60) -> bytes:
    return bytes(rteml.INDEX) + bytes([index]) + bytes(size - rteml.INDEX - 1)


def test_only_frames_of_the_cycle_count_and_only_meanwhile() -> None:
    frames = [
        (900, frame(1)),  # before
        (1000, frame(2)),
        (2000, frame(0x80)),  # of a conversation
        (3000, frame(3)),
        (4000, bytes(14)),  # too short to have a datagram
        (5001, frame(4)),  # after
    ]
    assert rteml.cyclic(frames, STRETCH, 7) == Capture((1000, 3000), (60, 60), 7)


def test_intervals_are_of_neighbours() -> None:
    found = rteml.intervals_us(Capture((0, 200_000, 390_000), (60,) * 3, 0))
    assert (found["mean"], found["max"], found["min"]) == (195.0, 200.0, 190.0)
    with pytest.raises(RoundError, match="only 1 frames"):
        rteml.intervals_us(Capture((0,), (60,), 0))


def test_without_a_network_the_published_row_remains() -> None:
    text = show(rteml.measure(Options(refused="not here")))
    assert "5702" in text
    assert "left out: all of ours" in text


@pytest.mark.usefixtures("veth")
def test_frames_are_captured() -> None:
    sheet = patiently(lambda: rteml.measure(Options(seconds=0.1, rates=(500,))))
    figures = json.loads(as_json("rteml", sheet))
    assert list(figures["ways"]) == ["catenary-threaded", "catenary-inline"]
    for way in figures["ways"].values():
        assert way["packets"] > 1
        assert min(way["sizes"]) >= 60
        assert way["loop"]["cycles"] > 1  # a busy machine skips cycles
