"""Distributed clocks on a kernel master: SYNC0, and the clock to follow."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.igh import Master
from catenary.plan.options import PlanOptions
from catenary.plan.planner import make_plan
from tests.igh.double import Double
from tests.igh.loops import clocked_loop, kernel_of

PERIOD_NS = 1_000_000


def times_of(calls: list[str], name: str) -> list[int]:
    return [int(call.split()[1]) for call in calls if call.startswith(f"{name} ")]


def test_sync0_fires_after_the_frames(main: cat.MainDevice, double: Double) -> None:
    with clocked_loop(main, margin=100e-6):
        pass
    [first, second] = [call for call in double.calls() if call.startswith("dc ")]
    position, assign, cycle, shift, *_ = first.split()[1:]
    assert (position, assign, int(cycle)) == ("0", "0300", PERIOD_NS)
    assert 100_000 < int(shift) < 200_000  # the margin, the wire and two devices
    assert second.split()[2:] == first.split()[2:]


def test_application_time_keeps_to_the_grid(main: cat.MainDevice, double: Double) -> None:
    with clocked_loop(main, lead="main") as loop:
        double.forget()
        for _ in range(5):
            next(loop)
        times = times_of(double.calls(), "application_time")
    assert {b - a for a, b in itertools.pairwise(times)} == {PERIOD_NS}


def test_the_reference_follows_the_machine(main: cat.MainDevice, double: Double) -> None:
    """1.5.2 has no call with a time argument, so the application time is used."""
    with clocked_loop(main, lead="main") as loop:
        double.forget()
        next(loop)
        calls = double.calls()
    asked = next(call for call in calls if call.startswith("sync_reference_clock"))
    assert asked.startswith("sync_reference_clock_to ") is ("1.6.1" in double.path.name)
    assert calls.index(asked) < calls.index("sync_slave_clocks") < calls.index("queue 0")


def test_an_external_clock_is_refused(main: cat.MainDevice) -> None:
    loop = clocked_loop(main, external="CLOCK_TAI")
    with pytest.raises(ConfigurationError, match="external= is not possible"), loop:
        pass


@pytest.mark.parametrize("ppm", [40, -40])
def test_the_machine_follows_the_reference(doubles: dict[str, Path], ppm: int) -> None:
    """The cycle starts follow a reference clock that is 40 ppm off, and stay in phase."""
    double = Double(doubles["1.6.1"])
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        main.scan()
        with clocked_loop(main, execution="inline") as loop:
            exchange = kernel_of(main).configuration.exchange
            begin = main.link.now()
            for _ in range(4000):
                machine = main.link.now() - int(exchange.figures["offset_ns"]) - begin
                double.reference(begin + machine + machine * ppm // 1_000_000)
                next(loop)
            figures = exchange.figures
    assert "sync_reference_clock" not in double.calls()
    assert abs(figures["phase_error_ns"]) < 100
    assert figures["rate_ns"] == pytest.approx(ppm, abs=2)


class Reference:
    """Owns a reference clock with an offset from the clock of the machine."""

    def __init__(self, main: cat.MainDevice, double: Double) -> None:
        self.main, self.double = main, double
        self.ahead_ns = 0

    @property
    def figures(self) -> dict[str, float]:
        return dict(kernel_of(self.main).configuration.exchange.figures)

    def follow(self, loop: cat.Loop, cycles: int, late_every: int = 0, late_ns: int = 0) -> None:
        """Run cycles. One of every `late_every` frames is late at the reference clock."""
        for number in range(cycles):
            machine = self.main.link.now() - int(self.figures["offset_ns"])
            late = late_ns if late_every and number % late_every == 0 else 0
            self.double.reference(machine + self.ahead_ns + late)
            next(loop)


@pytest.fixture
def reference(main: cat.MainDevice, double: Double) -> Reference:
    return Reference(main, double)


@pytest.mark.parametrize("periods", [-1, 4, -1000])
def test_whole_periods_are_not_a_phase_error(
    main: cat.MainDevice, double: Double, reference: Reference, periods: int
) -> None:
    """The master does not correct an offset below 1 ms.

    On a real master, -998115 ns were followed until the drives left OP with 0x001A.
    """
    reference.ahead_ns = periods * PERIOD_NS + 1885
    double.reference(main.link.now() + reference.ahead_ns)
    with clocked_loop(main, execution="inline", lead="reference") as loop:
        reference.follow(loop, 100)
        before = reference.figures["offset_ns"]
        reference.follow(loop, 1000)
        assert abs(reference.figures["offset_ns"] - before) < 2000
        assert abs(reference.figures["phase_error_ns"]) < 100
        assert loop.clocks.jumps == 0
        assert loop.clocks.locked


@pytest.mark.parametrize("share", [0.4, -0.3])
def test_the_phase_is_corrected_before_op(
    main: cat.MainDevice, double: Double, reference: Reference, share: float
) -> None:
    """The clocks keep the phase of an earlier loop.

    It is corrected on the way to OP, not by half a second of slewing in OP.
    """
    double.climb(60)
    arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, dc=True)
    main.read_mappings(arm)
    devices = [sub.description for sub in main.subs]
    main.configure(make_plan(devices, [arm], PlanOptions(clock="reference")))
    exchange, start = kernel_of(main).configuration.exchange, main.link.now()
    for cycle in range(100):  # SAFE-OP
        main.link.wait_until(start + cycle * PERIOD_NS, False)
        machine = main.link.now() - int(reference.figures["offset_ns"])
        double.reference(machine + int(share * PERIOD_NS))
        exchange.step()
    assert abs(reference.figures["phase_error_ns"]) < 2000
    assert reference.figures["offset_ns"] == pytest.approx(share * PERIOD_NS, abs=2000)


def test_late_frames_do_not_count_as_jumps(
    main: cat.MainDevice, double: Double, reference: Reference
) -> None:
    """A frame delayed by the segment or this thread does not measure the clocks."""
    with clocked_loop(main, execution="inline", lead="reference") as loop:
        reference.follow(loop, 200)
        loop.clocks.reset()
        assert loop.clocks.locked
        reference.follow(loop, 200, late_every=3, late_ns=300_000)
        reference.follow(loop, 200, late_every=4, late_ns=20_000)
        assert loop.clocks.jumps == 0
        assert loop.clocks.locked
        assert loop.clocks.largest_phase_error < 1e-6
        assert reference.figures["rate_ns"] == pytest.approx(0, abs=2)
        assert not [e for e in main.events if isinstance(e, cat.events.ClockUnlocked)]


def test_a_jump_in_op_is_followed_slowly(
    main: cat.MainDevice, double: Double, reference: Reference
) -> None:
    """The correction is 0.1 % of the period per cycle, and the rate does not change."""
    with clocked_loop(main, execution="inline", lead="reference") as loop:
        reference.follow(loop, 100)
        before = int(reference.figures["offset_ns"])
        reference.ahead_ns += 300_000
        reference.follow(loop, 100)
        moved = int(reference.figures["offset_ns"]) - before
        assert loop.clocks.jumps == 1
        assert 80_000 < moved <= 100 * PERIOD_NS // 1000
        assert reference.figures["rate_ns"] == pytest.approx(0, abs=2)
        reference.follow(loop, 1000)
        assert abs(reference.figures["phase_error_ns"]) < 1000


def test_a_reference_clock_can_be_chosen(main: cat.MainDevice, double: Double) -> None:
    arm = cat.Drives([main.subs[1]], counts_per_turn=1000, velocity_limit=100.0, dc=True)
    with cat.Loop(arm, clocks=cat.ClockOptions(reference=main.subs[1])):
        pass
    assert "select_reference_clock 1" in double.calls()


@pytest.mark.parametrize("clock", ["main", "reference"])
def test_the_figures_of_the_clocks(main: cat.MainDevice, double: Double, clock: str) -> None:
    """Each cycle measures the phase and the largest difference; single ones are read in turn."""
    double.spread(300)
    double.register(1, 0x092C, 0x00FA)
    with clocked_loop(main, lead=clock) as loop:
        loop.wait_locked(within=1e-6)
        assert loop.clocks.locked
        for _ in range(60):
            next(loop)
        assert loop.clocks.reference is main.subs[0]
        assert loop.clocks.differences == {1: pytest.approx(250e-9)}
        assert abs(loop.clocks.phase_error) < 1e-6
        assert "device 1" in str(loop.clocks)
        assert any(isinstance(event, cat.events.ClockLocked) for event in main.events)
        double.spread(20_000)
        for _ in range(100):
            next(loop)
        assert not loop.clocks.locked
        assert any(isinstance(event, cat.events.ClockUnlocked) for event in main.events)


def test_clocks_that_do_not_synchronise_are_an_error(main: cat.MainDevice, double: Double) -> None:
    double.spread(50_000)
    with (
        clocked_loop(main) as loop,
        pytest.raises(cat.errors.ClockError, match=r"not within 1 us after 0\.2 s"),
    ):
        loop.wait_locked(within=1e-6, timeout=0.2)


def test_a_silent_reference_is_read_rarely(main: cat.MainDevice, double: Double) -> None:
    """libethercat prints a line on stderr for each read without an answer."""
    with clocked_loop(main) as loop:
        double.fail(b"reference_clock_time", -6)
        double.forget()
        for _ in range(200):
            next(loop)
        assert loop.clocks.missed <= 18
        assert not loop.clocks.locked
        assert double.calls().count("reference_clock_time") <= 18


def test_clocks_stay_synchronised_without_an_optional_device(
    main: cat.MainDevice, double: Double
) -> None:
    """Its domain stays incomplete, but the cycle still follows the clock."""
    arm = cat.Drives([main.subs[0]], counts_per_turn=1000, velocity_limit=100.0, dc=True)
    tool = cat.Drives([main.subs[1]], counts_per_turn=1000, velocity_limit=100.0, required=False)
    with cat.Loop(arm, tool) as loop:
        for _ in range(50):
            next(loop)
        double.online(1, 0)
        double.spread(20_000)
        for _ in range(100):
            next(loop)
        assert not tool.present.any()
        assert not loop.clocks.locked


def test_waiting_without_clocks_is_refused(main: cat.MainDevice) -> None:
    with (
        cat.Loop(cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0)) as loop,
        pytest.raises(RuntimeError, match="no distributed clocks"),
    ):
        _ = loop.clocks
