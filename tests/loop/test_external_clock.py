"""A loop whose cycle starts follow an external clock, in virtual time; and the clocks."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.event_types import ExternalClockChanged
from catenary.loop.clock_discipline import ClockSample
from catenary.loop.external_clock import HardwareClock, read_sample
from catenary.virtual import Segment
from tests.scenario.cell import Cell
from tests.scenario.clocked import clocked_cell, run_for, true_differences

PERIOD = 1e-3


class Crystal:
    """External clock: the time of a segment with another rate, with jumps and gaps."""

    def __init__(self, segment: Segment, ppm: float) -> None:
        self._segment = segment
        self._rate = 1 + ppm * 1e-6
        self.offset_ns = 123_456_789
        self.answers = True
        self.is_faulty = False
        self.fault: Exception | None = None

    def at(self, local_ns: float) -> float:
        """Return its time [ns] at a time of the segment [ns]."""
        return local_ns * self._rate + self.offset_ns

    def time_ns(self) -> int:
        if not self.answers:
            raise OSError("the device has gone")
        if self.is_faulty:
            if self.fault is not None:
                raise self.fault
            return None  # type: ignore[return-value]
        return round(self.at(self._segment.now_ns))


@pytest.fixture
def cell() -> Iterator[Cell]:
    with clocked_cell(3) as found:
        yield found


def changes(cell: Cell) -> list[ExternalClockChanged]:
    return [event for event in cell.main.events if isinstance(event, ExternalClockChanged)]


def lateness(loop: cat.Loop, crystal: Crystal, phase_ns: float = 0.0) -> float:
    """Return the lateness of the newest logged cycle start in the time of the crystal [s]."""
    start = float(loop.log["scheduled_ns"][-1])
    return math.remainder(crystal.at(start) - phase_ns, PERIOD * 1e9) * 1e-9


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_the_cycle_follows_a_faster_clock(cell: Cell, execution: str) -> None:
    crystal = Crystal(cell.segment, ppm=80)
    clocks = cat.ClockOptions(external=cat.ExternalClock(crystal, phase=0.2e-3))
    with cat.Loop(cell.drives(), period=PERIOD, execution=execution, clocks=clocks) as loop:  # type: ignore[arg-type]
        run_for(loop, 15.0)
        assert loop.external.locked
        assert loop.external.rate == pytest.approx(80e-6, abs=1e-6)
        assert abs(lateness(loop, crystal, 0.2e6)) < 0.5e-6
        assert "locked" in str(loop.external)
    assert [change.state for change in changes(cell)] == ["locked"]


def test_sync0_follows_too(cell: Cell) -> None:
    """Distributed clocks follow the MainDevice, whose cycle starts follow the external clock."""
    crystal = Crystal(cell.segment, ppm=-120)
    clocks = cat.ClockOptions(external=cat.ExternalClock(crystal))
    with cat.Loop(cell.drives(dc=True), period=PERIOD, clocks=clocks) as loop:
        run_for(loop, 15.0)
        loop.wait_locked(within=2e-6, timeout=5.0)
        assert loop.external.locked
        clock = loop.plan.cycle.clock
        assert clock is not None
        assert abs(lateness(loop, crystal, clock.phase_ns)) < 0.5e-6
        assert all(abs(d) < 1e-6 for d in true_differences(cell.segment).values())
        reference = cell.segment.core.system_time(0)
        now = crystal.at(cell.segment.now_ns)
        assert abs(math.remainder(reference - now, PERIOD * 1e9)) < 3000  # [ns]
        assert loop.timing.counters["missed_sync"] == 0


def test_a_jump_and_a_loss_are_reported_and_no_frame_is_lost(cell: Cell) -> None:
    crystal = Crystal(cell.segment, ppm=10)
    clocks = cat.ClockOptions(external=cat.ExternalClock(crystal))
    with cat.Loop(cell.drives(dc=True), period=PERIOD, clocks=clocks) as loop:
        run_for(loop, 15.0)
        crystal.offset_ns += 300_000
        run_for(loop, 15.0)
        assert loop.external.jumps == 1
        assert abs(lateness(loop, crystal, loop.plan.cycle.clock.phase_ns)) < 0.5e-6  # type: ignore[union-attr]
        crystal.answers = False
        run_for(loop, 5.0)
        assert loop.external.state == "lost"
        assert loop.external.rate == pytest.approx(10e-6, abs=1e-6)
        crystal.answers = True
        run_for(loop, 5.0)
        assert loop.external.locked
        assert loop.timing.counters["late"] == 0
        assert loop.timing.counters["lost"] == 0
    found = changes(cell)
    states = [event.state for event in found]
    jump, loss = ["seeking", "seeking", "locked"], ["lost", "seeking", "locked"]
    assert states == ["locked", *jump, *loss]
    assert "jumped" in found[1].message


@pytest.mark.parametrize("fault", [ValueError("no battery"), None])
def test_a_fault_of_the_clock_of_a_program_is_a_loss(cell: Cell, fault: Exception | None) -> None:
    crystal = Crystal(cell.segment, ppm=10)
    clocks = cat.ClockOptions(external=cat.ExternalClock(crystal))
    with cat.Loop(cell.drives(), period=PERIOD, clocks=clocks) as loop:
        run_for(loop, 15.0)
        crystal.fault, crystal.is_faulty = fault, True
        run_for(loop, 5.0)
        assert loop.external.state == "lost"
        assert loop.external.rate == pytest.approx(10e-6, abs=1e-6)
        crystal.is_faulty = False
        run_for(loop, 5.0)
        assert loop.external.locked
    found = [event.message for event in changes(cell)]
    assert len(found) == 5
    assert ("no battery" if fault else "NoneType") in found[1]


def test_a_loop_without_an_external_clock(cell: Cell) -> None:
    with (
        cat.Loop(cell.drives(), period=PERIOD) as loop,
        pytest.raises(RuntimeError, match="no external clock"),
    ):
        _ = loop.external


@pytest.mark.parametrize("rate", [1.1e-3, -1.1e-3, math.nan])
def test_an_impossible_rate(cell: Cell, rate: float) -> None:
    with (
        cat.Loop(cell.drives(), period=PERIOD) as loop,
        pytest.raises(ValueError, match="steer"),
    ):
        loop.networks[0].session.engine.steer(rate)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"lead": "reference", "external": "/dev/ptp0"}, ValueError, "two clocks"),
        ({"external": 3}, TypeError, "external=3"),
        ({"external": "ptp0"}, ValueError, "/dev/ptp0"),
    ],
)
def test_impossible_clock_options(
    options: dict[str, object], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        cat.ClockOptions(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options", [{"rate_limit": 0.0}, {"rate_limit": 2e-3}, {"within": 0.0}, {"phase": math.nan}]
)
def test_impossible_options_of_an_external_clock(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        cat.ExternalClock("/dev/ptp0", **options)


def test_a_file_that_is_not_a_clock(tmp_path: Path) -> None:
    path = tmp_path / "ptp9"
    with pytest.raises(cat.ClockError, match="No such file"):
        HardwareClock(str(path))
    path.write_text("")
    with pytest.raises(cat.ClockError, match="not a PTP hardware clock"):
        HardwareClock(str(path))


def test_a_missing_device_is_an_error_of_the_loop(cell: Cell) -> None:
    clocks = cat.ClockOptions(external="/dev/no-such-ptp")
    with (
        pytest.raises(cat.ClockError, match="no-such-ptp"),
        cat.Loop(cell.drives(), period=PERIOD, clocks=clocks),
    ):
        pass


def test_a_device_of_root_has_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: str, flags: int) -> int:
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr("os.open", refuse)
    with pytest.raises(cat.ClockError, match="Permission denied") as caught:
        HardwareClock("/dev/ptp0")
    assert "udev" in (caught.value.hint or "")


def test_the_kernels_clocks() -> None:
    assert cat.ExternalClock("CLOCK_REALTIME").open().time_ns() == pytest.approx(
        time.time_ns(), abs=60e9
    )


def test_several_networks_refuse_an_external_clock(cell: Cell) -> None:
    with clocked_cell(3) as other, pytest.raises(ValueError, match="one network"):
        cat.Loop(cell.drives(), other.drives(), clocks=cat.ClockOptions(external="/dev/ptp0"))


def test_the_shortest_reading_counts() -> None:
    times = iter(
        [0, 90_000, 200_000, 210_000, 300_000, 390_000, 400_000, 490_000, 500_000, 590_000]
    )

    class Source:
        def time_ns(self) -> int:
            return 1_000_000

    sample = read_sample(Source(), lambda: next(times), lambda: 7)
    assert sample == ClockSample(205_000, 795_000, 7)


def test_an_interrupted_reading_is_not_used() -> None:
    times = iter(range(0, 10_000_000, 150_000))

    class Source:
        def time_ns(self) -> int:
            return 0

    assert read_sample(Source(), lambda: next(times), lambda: 0) is None
