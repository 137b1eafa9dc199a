"""Two networks in one loop, an upper and a lower body with one schedule. Both are complete.
The failure of one network does not delay the other.
Leaving the loop stops every network that answers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

import catenary as cat
from catenary.errors import StateError, WorkingCounterError
from catenary.realtime import VirtualClock
from catenary.virtual import Coupler, Crystal, Segment, Servo
from catenary.virtual.faults import power_cycle


@dataclass
class Body:
    upper: Segment
    lower: Segment
    upper_main: cat.MainDevice
    lower_main: cat.MainDevice

    def requests(self) -> tuple[cat.Drives, cat.Drives]:
        return tuple(
            cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=100.0)
            for main in (self.upper_main, self.lower_main)
        )  # type: ignore[return-value]

    def assert_safe(self) -> None:
        for segment in (self.upper, self.lower):
            assert all(device.state & 0x0F < 8 for device in segment)
            assert all(servo.drive_state() != "OPERATION ENABLED" for servo in list(segment)[1:])


@pytest.fixture
def body() -> Iterator[Body]:
    yield from bodies(3, 2)


def bodies(upper_axes: int, lower_axes: int) -> Iterator[Body]:
    with VirtualClock() as clock:
        upper = Segment([Coupler(), *(Servo(serial=k) for k in range(upper_axes))], clock=clock)
        lower = Segment([Coupler(), *(Servo(serial=k) for k in range(lower_axes))], clock=clock)
        with cat.MainDevice(upper) as first, cat.MainDevice(lower) as second:
            first.scan()
            second.scan()
            yield Body(upper, lower, first, second)


def test_both_networks_follow_in_every_cycle(body: Body) -> None:
    upper, lower = body.requests()
    with cat.Loop(upper, lower, period=1e-3) as loop:
        homes = upper.actual.position.copy(), lower.actual.position.copy()
        for cycle in loop:
            assert cycle.ok
            assert [network.ok for network in cycle.networks] == [True, True]
            upper.target.position[:] = homes[0] + 0.3 * cycle.time
            lower.target.position[:] = homes[1] - 0.3 * cycle.time
            if cycle.time > 0.5:
                break
        assert upper.actual.position == pytest.approx(homes[0] + 0.15, abs=0.01)
        assert lower.actual.position == pytest.approx(homes[1] - 0.15, abs=0.01)
        counters = [network.timing.counters for network in loop.networks]
        assert [each["lost"] for each in counters] == [0, 0]
        assert [each["late"] for each in counters] == [0, 0]
        numbers = {network.number for network in cycle.networks}
        assert len(numbers) == 1
    body.assert_safe()


@pytest.mark.parametrize("hertz", [4000, 8000])
def test_33_axes_at_4_and_8_khz(hertz: int) -> None:
    """All cycles of 18 + 15 axes, as in TOCABI, are complete."""
    for body in bodies(18, 15):
        upper, lower = body.requests()
        with cat.Loop(upper, lower, period=1 / hertz) as loop:
            for cycle in loop:
                assert cycle.ok
                if cycle.number == 500:
                    break
            for network in loop.networks:
                assert network.timing.counters["lost"] == 0
                assert network.timing.counters["late"] == 0
        body.assert_safe()


def test_a_lost_network_ends_the_loop_and_the_other_is_stopped(body: Body) -> None:
    upper, lower = body.requests()
    with pytest.raises(WorkingCounterError, match="no device answers"):
        run_and_kill(body, upper, lower)
    assert all(device.state & 0x0F < 8 for device in body.lower)
    body.upper.plug()


def run_and_kill(
    body: Body, upper: cat.Drives, lower: cat.Drives, quorum: int | None = None
) -> list[tuple[bool, bool, bool]]:
    seen = []
    with cat.Loop(upper, lower, scheduling=cat.Scheduling(quorum=quorum)) as loop:
        home = lower.actual.position.copy()
        for cycle in loop:
            lower.target.position[:] = home + 0.2 * cycle.time
            seen.append((cycle.ok, cycle.networks[0].ok, cycle.networks[1].ok))
            if cycle.number == 100:
                body.upper.unplug()
            if cycle.number == 400:
                break
        assert lower.enabled.all()
        assert lower.actual.position == pytest.approx(home + 0.08, abs=0.01)
    return seen


def test_with_a_quorum_the_other_network_continues(body: Body) -> None:
    upper, lower = body.requests()
    seen = run_and_kill(body, upper, lower, quorum=1)
    assert seen[50] == (True, True, True)
    assert seen[-1] == (True, False, True)
    assert all(state & 0x0F < 8 for state in (device.state for device in body.lower))
    assert "OPERATION ENABLED" not in [servo.drive_state() for servo in list(body.upper)[1:]]
    body.upper.plug()


def test_a_returning_network_does_not_stop_the_other(body: Body) -> None:
    """Watchdogs took its devices out of OP. They return to OP, and move only after a request."""
    upper, lower = body.requests()
    with cat.Loop(upper, lower, scheduling=cat.Scheduling(quorum=1)) as loop:
        home = lower.actual.position.copy()
        for cycle in loop:
            assert cycle.ok
            lower.target.position[:] = home + 0.2 * cycle.time
            if cycle.number == 100:
                body.upper.unplug()
            if cycle.number == 500:
                assert not cycle.networks[0].ok
                body.upper.plug()
            if cycle.number == 800:
                break
        assert cycle.networks[0].ok
        assert [device.state for device in body.upper] == [8] * 4
        assert not upper.enabled.any()
        assert lower.enabled.all()
        assert lower.actual.position == pytest.approx(home + 0.16, abs=0.01)
    body.assert_safe()


@pytest.mark.parametrize("quorum", [1, 2])
def test_a_network_that_answers_out_of_op_does_not_count(body: Body, quorum: int) -> None:
    """It is unplugged long enough for watchdogs to stop its drives, but not to count as lost."""
    upper, lower = body.requests()
    with (
        pytest.raises((WorkingCounterError, StateError)),
        cat.Loop(upper, lower, scheduling=cat.Scheduling(quorum=quorum)) as loop,
    ):
        for cycle in loop:
            if cycle.number == 100:
                body.upper.unplug()
            if cycle.number == 220:
                body.upper.plug()
            if cycle.number == 230:
                assert quorum == 1
                body.lower.unplug()
            assert cycle.number < 250
    body.lower.plug()


def test_a_device_that_refuses_op_brings_both_networks_down(body: Body) -> None:
    from catenary.virtual.faults import refuse_state

    body.lower.inject(refuse_state(1, "OP", code=0x001B, at=0))
    upper, lower = body.requests()
    with pytest.raises(StateError, match="device 1"), cat.Loop(upper, lower):
        raise AssertionError("the loop was opened")
    body.assert_safe()


def test_their_clocks_follow_the_main_device() -> None:
    """Two reference clocks have two times. One schedule needs one time, which both follow."""
    with VirtualClock() as clock:
        crystals = [Crystal(ppm=100.0), Crystal(ppm=-60.0)]
        segments = [Segment([Coupler(crystal=c), Servo()], clock=clock) for c in crystals]
        with cat.MainDevice(segments[0]) as first, cat.MainDevice(segments[1]) as second:
            requests = [
                cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0, dc=True)
                for main in (first, second)
            ]
            with cat.Loop(*requests) as loop:
                loop.wait_locked(within=1e-6, timeout=2.0)
                assert [network.clocks.locked for network in loop.networks] == [True, True]
                for cycle in loop:
                    assert cycle.ok
                    assert not cycle.late
                    assert len({network.number for network in cycle.networks}) == 1
                    if cycle.time > 10.0:
                        break
                assert [network.clocks.locked for network in loop.networks] == [True, True]
            with pytest.raises(ValueError, match='lead="main"'):
                cat.Loop(*requests, clocks=cat.ClockOptions(lead="reference"))


def test_waiting_for_clocks_without_a_request_is_refused(body: Body) -> None:
    with (
        cat.Loop(*body.requests()) as loop,
        pytest.raises(RuntimeError, match="dc=True"),
    ):
        loop.wait_locked()


def test_a_device_is_released_in_its_own_network(body: Body) -> None:
    """In both networks, the device at the position was switched off and on, and is held."""
    upper, lower = [
        cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=100.0, required=False)
        for main in (body.upper_main, body.lower_main)
    ]
    with cat.Loop(upper, lower, stop=cat.StopPolicy(on_return="hold")) as loop:
        for cycle in loop:
            if cycle.number == 20:
                for segment in (body.upper, body.lower):
                    segment.inject(power_cycle(2, at=0, for_=0.2))
            if cycle.number == 1500:
                assert [s[2].state for s in (body.upper, body.lower)] == [2, 2]
                loop.restore(body.lower_main.subs[2])
            if cycle.number == 2500:
                break
        assert [s[2].state for s in (body.upper, body.lower)] == [2, 8]
        with (
            cat.MainDevice(Segment([Coupler(), Servo(), Servo()])) as other,
            pytest.raises(ValueError, match="not in this loop"),
        ):
            loop.restore(other.scan()[2])


def test_options_for_one_network_only_are_refused(body: Body) -> None:
    upper, lower = body.requests()
    with pytest.raises(ValueError, match="threaded"):
        cat.Loop(upper, lower, execution="inline")
    with pytest.raises(ValueError, match="quorum"):
        cat.Loop(upper, lower, scheduling=cat.Scheduling(quorum=3))
    with pytest.raises(ValueError, match="a request names devices of several"):
        both = [body.upper_main.subs[1], body.lower_main.subs[2]]
        cat.Loop(cat.Drives(both, counts_per_turn=2**20, velocity_limit=100.0))


def test_segments_with_separate_clocks_are_refused() -> None:
    segments = Segment([Servo()]), Segment([Servo(), Servo()])
    with cat.MainDevice(segments[0]) as first, cat.MainDevice(segments[1]) as second:
        requests = [
            cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
            for main in (first, second)
        ]
        with pytest.raises(ValueError, match="VirtualClock"), cat.Loop(*requests):
            raise AssertionError("the loop was opened")
