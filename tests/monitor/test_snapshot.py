"""Summaries of a share: bus, axes, remarks and texts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import catenary as cat
from catenary.core import AXIS_DROPPED, AXIS_LIMITED, CYCLE_OK
from catenary.monitor.snapshot import Summaries, axis_summaries, bus_summary, mode_text, plain
from catenary.monitor.source import Source
from tests.record.beside import shared_loop
from tests.share.names import own_name


@pytest.fixture
def name() -> Iterator[str]:
    with own_name("top") as name:
        yield name


def test_a_summary_covers_the_cycles_since_the_last_one(name: str) -> None:
    with shared_loop(name) as shared, cat.attach(name) as reader:
        summaries = Summaries(reader)
        shared.run(100)
        summary = summaries.take()
        assert summary is not None
        assert 100 <= summary.bus.cycles <= 102
        assert (summary.number, summary.bus.lost, summary.bus.skipped) == (reader.number, 0, 0)
        assert summaries.take() is None
        assert [axis.state for axis in summary.axes] == ["operation enabled"] * 3
        assert [axis.position for axis in summary.axes] == reader.read()["position"].tolist()
        assert {(axis.mode, axis.enabled, axis.fault) for axis in summary.axes} == {
            ("CSP", True, False)
        }


def test_lost_cycles_and_times_are_those_of_all_rows(name: str) -> None:
    with shared_loop(name) as shared, cat.attach(name) as reader:
        shared.run(10)
        rows = reader.rows(0)[0].copy()
    rows["flags"][:3] &= ~np.uint32(CYCLE_OK)
    rows["skipped"][4], rows["lateness_ns"][5], rows["lost_in_row"][-1] = 2, 7000, 1
    rows["receive_ns"], rows["process_ns"], rows["send_ns"] = 1000, 2000, -1
    rows["round_trip_ns"][0] = -1
    bus = bus_summary(rows, overwritten=5)
    assert (bus.cycles, bus.lost, bus.skipped) == (len(rows) + 5, 3, 2)
    assert (bus.lateness, bus.lost_in_row) == (pytest.approx(7e-6), 1)
    assert np.isnan(bus.in_controller)
    assert bus.round_trip == pytest.approx(float(np.median(rows["round_trip_ns"][1:])) * 1e-9)


def test_faults_and_remarks_of_axes(name: str) -> None:
    with shared_loop(name) as shared, cat.attach(name) as reader:
        shared.run(10)
        row, layout = reader.rows(0)[0][-1].copy(), reader.layout
    row["statusword"][1] = 0x0008
    row["axis_flags"][1] = AXIS_DROPPED | AXIS_LIMITED
    axis = axis_summaries(layout, row)[1]
    assert (axis.state, axis.fault, axis.remarks) == ("fault", True, "stopped, limited")


def test_texts_have_no_control_characters() -> None:
    assert plain("a\x1b[31mb\n") == "a?[31mb?"
    assert (mode_text(8), mode_text(-3)) == ("CSP", "-3")


def test_a_source_attaches_again_when_the_loop_returns(name: str) -> None:
    with shared_loop(name) as shared:
        shared.run(10)
        source = Source(name)
        shared.run(10)
        assert source.take() is not None
    source.take()
    assert source.take() is None
    assert source.reason == "the loop has ended"
    with shared_loop(name, axes=2) as shared:
        source.take()
        shared.run(10)
        summary = source.take()
        assert summary is not None
        assert (source.reason, len(summary.axes)) == ("", 2)
    source.close()


def test_a_source_stops_all_axes(name: str) -> None:
    with shared_loop(name) as shared:
        shared.run(10)
        source = Source(name)
        source.stop()
        with pytest.raises(cat.DriveError, match="an operator requested a quick stop"):
            shared.run(200)
        source.close()
