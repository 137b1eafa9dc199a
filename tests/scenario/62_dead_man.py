"""An operator jogs a vertical axis, and its heartbeats fail: they are missing, old, or delayed.
The core stops the axis 200 ms after the issue of the last echoed token, in every execution mode,
while the body is stuck and while a law runs. Only a new press moves it again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest

import catenary as cat
from catenary.errors import MoveError, WorkingCounterError
from catenary.plan.stop_reason import StopReason
from catenary.share import Jog, JogStatus, Lease, Reader, Sweep
from tests.scenario.vertical import LAG, MS, RESOLUTION, VerticalCell, vertical_cell
from tests.share.names import own_name

SPEED, DECELERATION = 0.5, 10.0  # rad/s, rad/s²
ALIVE = 0.200  # s, granted by a token
DELAY = 3 * MS  # from a command to its effect
# The way after a heartbeat: the time of its token, the ramp, and the lag of the drive.
WAY = SPEED * (ALIVE + DELAY) + SPEED**2 / (2 * DECELERATION) + SPEED * (10 * MS + LAG)
RAMP_WAY = WAY - SPEED * ALIVE  # after a release
MODES = ["csp", "csv", "pv"]
EVENT = cat.StopPolicy(on_axis_stopped="event")


class Desk:
    """An operator at a share, whose loop the test iterates."""

    def __init__(
        self, cell: VerticalCell, arm: cat.Drives, loop: cat.Loop, share: cat.Share, reader: Reader
    ) -> None:
        self.cell, self.arm, self.loop, self.share, self.reader = cell, arm, loop, share, reader
        self.lease: Lease = reader.lease(for_=3600.0)

    def steps(self, cycles: int, jog: Jog | None = None) -> None:
        """Iterate, with a heartbeat of the jog in every cycle."""
        for _ in range(cycles):
            if jog is not None:
                jog.beat()
            next(self.loop)

    def jog(self, cycles: int, velocity: float = SPEED) -> Jog:
        """Jog for some cycles with heartbeats, and check that the axis moves."""
        jog = self.lease.jog(0, velocity)
        before = self.cell.joint
        self.steps(cycles, jog)
        assert jog.status is JogStatus.MOVING
        assert abs(self.cell.joint - before) > 0.2 * abs(velocity) * cycles * MS
        return jog

    def assert_at_rest(self) -> None:
        """Check that the axis stands still from now on, under power."""
        before = self.cell.joint
        for _ in range(300):
            next(self.loop)
            assert abs(self.cell.joint - before) < RESOLUTION
        assert self.cell.powered


@contextmanager
def operated(
    mode: str = "csp",
    *,
    execution: str = "threaded",
    stop: cat.StopPolicy = EVENT,
    jog: bool = True,
) -> Iterator[Desk]:
    with own_name("dead-man") as name, vertical_cell() as cell:
        arm = cell.drives(
            mode=mode,
            velocity_limit=1.0,
            deceleration_limit=DECELERATION,
            acceleration_limit=DECELERATION,
        )
        with (
            cat.Share(name, jog=jog) as share,
            cat.Loop(arm, sink=share, execution=execution, stop=stop) as loop,  # type: ignore[arg-type]
            cat.attach(name) as reader,
        ):
            desk = Desk(cell, arm, loop, share, reader)
            desk.steps(200)
            assert arm.enabled.all()
            yield desk


@pytest.mark.parametrize("execution", ["threaded", "inline"])
@pytest.mark.parametrize("mode", MODES)
def test_a_release_stops_the_axis(mode: str, execution: str) -> None:
    with operated(mode, execution=execution) as desk:
        jog = desk.jog(300)
        before = desk.cell.joint
        jog.release()
        desk.steps(200)
        assert jog.status is JogStatus.RELEASED
        assert 0 < desk.cell.joint - before < RAMP_WAY
        assert desk.arm.enabled.all()
        desk.assert_at_rest()


@pytest.mark.parametrize("execution", ["threaded", "inline"])
@pytest.mark.parametrize("mode", MODES)
def test_without_heartbeats_the_axis_stops(mode: str, execution: str) -> None:
    with operated(mode, execution=execution) as desk:
        jog = desk.jog(300)
        before = desk.cell.joint
        desk.steps(400)
        assert jog.status is JogStatus.EXPIRED
        assert 0 < desk.cell.joint - before < WAY
        desk.assert_at_rest()


@pytest.mark.parametrize("mode", MODES)
def test_a_sweep_swings_the_axis_and_ends_at_rest(mode: str) -> None:
    with operated(mode) as desk:
        jog = desk.lease.jog(0, SPEED, sweep=Sweep(start=1.0, end=10.0, duration=2.0))
        before, path = desk.cell.joint, []
        for _ in range(2100):
            desk.steps(1, jog)
            path.append(desk.cell.joint - before)
        steps = [b - a for a, b in pairwise(path[::20])]
        turns = [a for a, b in pairwise(steps) if a * b < 0]  # changes of direction
        assert jog.status is JogStatus.DONE
        assert (
            max(map(abs, path)) < SPEED / math.pi + RAMP_WAY
        )  # the first half-wave is the longest
        assert len(turns) >= 8  # of 2 · 7.8 half-waves
        desk.assert_at_rest()


def test_a_sweep_without_heartbeats_ends_while_the_body_is_stuck() -> None:
    with operated() as desk:
        jog = desk.lease.jog(0, SPEED, sweep=Sweep(start=1.0, end=10.0, duration=60.0))
        desk.steps(300, jog)
        before = desk.cell.joint
        cycle = next(desk.loop)
        trace = desk.cell.compute(cycle, 1.0)
        assert jog.status is JogStatus.EXPIRED
        assert abs(trace.joint - before).max() < WAY
        desk.assert_at_rest()


def test_a_burst_of_old_heartbeats_extends_nothing() -> None:
    with operated() as desk:
        jog = desk.lease.jog(0, SPEED)
        tokens = []
        for _ in range(300):
            tokens.append(desk.reader.token)
            desk.steps(1, jog)
        before = desk.cell.joint
        for token in [*tokens, *tokens]:  # as from a network that has held them back
            jog.beat(token)
            desk.steps(1)
        assert jog.status is JogStatus.EXPIRED
        assert desk.cell.joint - before < WAY
        jog.beat()  # a fresh one does not move it again
        desk.assert_at_rest()
        desk.jog(100, -SPEED)  # a new press does


def test_a_stuck_body_does_not_defeat_it() -> None:
    with operated() as desk:
        jog = desk.jog(300)
        before = desk.cell.joint
        cycle = next(desk.loop)
        trace = desk.cell.compute(cycle, 1.0)
        assert jog.status is JogStatus.EXPIRED
        assert 0 < trace.joint.max() - before < WAY
        desk.assert_at_rest()


def test_a_release_counts_while_the_body_is_stuck() -> None:
    with operated() as desk:
        jog = desk.jog(300)
        cycle = next(desk.loop)
        jog.release()
        before = desk.cell.joint
        desk.cell.compute(cycle, 0.2)
        assert jog.status is JogStatus.RELEASED
        assert desk.cell.joint - before < RAMP_WAY


def test_inline_the_watchdog_acts_while_the_body_is_stuck() -> None:
    """Nothing is sent. The drive extrapolates nothing: it stops by 0x6007 after the watchdog."""
    with operated(execution="inline") as desk:
        desk.jog(300)
        before = desk.cell.joint
        desk.cell.let_pass(1.0)
        assert not desk.cell.powered
        assert abs(desk.cell.joint - before) < WAY


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_a_law_ignores_the_axis_and_gets_it_back(execution: str) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")

    def sway(actual, target, memory, time):
        memory[1] = max(memory[1], 1.0 - actual.enabled[0])
        if actual.enabled[0]:
            memory[0] = target.position[0] if memory[0] == 0.0 else memory[0]
            target.position[0] = memory[0]
        else:
            memory[0] = 0.0

    with operated(execution=execution) as desk:
        run = desk.loop.start(sway, memory=[0.0, 0.0])
        desk.steps(50)
        jog = desk.jog(300)
        before = desk.cell.joint
        desk.steps(400)
        assert jog.status is JogStatus.EXPIRED
        assert 0 < desk.cell.joint - before < WAY
        assert run.running
        assert run.memory[1] == 1.0  # it has seen that the axis was not enabled
        desk.assert_at_rest()


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_a_hand_over_does_not_defeat_it(execution: str) -> None:
    with operated(execution=execution) as desk:
        jog = desk.jog(300)
        before = desk.cell.joint
        desk.loop.networks[0].session.engine.run(400)  # as during a slow call
        assert jog.status is JogStatus.EXPIRED
        assert 0 < desk.cell.joint - before < WAY


def test_link_down_ends_the_jog() -> None:
    with pytest.raises(WorkingCounterError), operated() as desk:
        jog = desk.jog(300)
        desk.cell.segment.unplug()
        try:
            desk.steps(20, jog)
        finally:
            assert jog.status is JogStatus.ENDED_STOPPED
            desk.cell.let_pass(0.5)
            assert not desk.cell.powered
            desk.cell.segment.plug()


def test_the_watchdog_acts_if_the_process_of_the_loop_is_killed_during_a_jog() -> None:
    """Without the process, the watchdog of the drive stops the axis."""
    patient = cat.StopPolicy(on_axis_stopped="event", raise_faults=False)
    with operated(stop=patient) as desk:
        desk.jog(300)
        before = desk.cell.joint
        desk.loop._opened.engine.stop()  # as after a kill: no more frames
        desk.cell.let_pass(1.0)
        assert not desk.cell.powered
        assert abs(desk.cell.joint - before) < SPEED * (0.1 + DELAY) + RAMP_WAY
        assert abs(desk.cell.velocity) < 1e-3
        desk.loop._opened.engine.start()


def test_the_stop_needs_no_lease_and_ends_the_jog() -> None:
    with operated() as desk:
        jog = desk.jog(300)
        before = desk.cell.joint
        with cat.attach(desk.share.name) as other:
            other.stop()
        desk.steps(300)
        assert jog.status is JogStatus.ENDED_STOPPED
        assert desk.arm.stopped == (StopReason.OPERATOR,)
        assert not desk.cell.powered
        assert desk.cell.joint - before < RAMP_WAY
        [stopped] = [
            event for event in desk.cell.main.events if isinstance(event, cat.events.AxisStopped)
        ]
        assert stopped.reason is StopReason.OPERATOR
        assert "an operator requested a quick stop (process " in stopped.message


def test_the_stop_acts_while_the_body_is_stuck() -> None:
    with operated(jog=False) as desk:
        cycle = next(desk.loop)
        desk.reader.stop()
        desk.cell.compute(cycle, 0.1)
        assert not desk.cell.powered


def test_an_unasked_stop_raises_unless_it_is_an_event() -> None:
    with (
        pytest.raises(cat.errors.DriveError, match="an operator requested a quick stop"),
        operated(stop=cat.StopPolicy()) as desk,
    ):
        desk.reader.stop()
        desk.steps(5)


def test_a_jog_does_not_end_the_loop_of_an_application() -> None:
    """The program writes the same absolute target for ever, far from where the jog ends."""
    with operated(stop=cat.StopPolicy()) as desk:
        home = desk.arm.target.position.copy()
        jog = desk.lease.jog(0, SPEED, distance=0.3)
        for _ in range(1000):
            jog.beat()
            desk.arm.target.position[:] = home
            next(desk.loop)
        assert jog.status is JogStatus.DONE
        assert desk.cell.powered
        assert desk.cell.joint == pytest.approx(0.3, abs=0.01)  # refused; the axis holds


def test_a_move_is_refused_and_names_the_jog() -> None:
    with operated() as desk:
        desk.jog(100)
        with pytest.raises(cat.errors.DriveError, match="an operator jogs the axis"):
            desk.arm.move_to(0.0)


def test_a_move_that_has_just_begun_ends_with_an_error_that_names_the_jog() -> None:
    with operated() as desk:
        move = desk.arm.move_by(0.5)
        jog = desk.lease.jog(0, SPEED)
        desk.steps(100, jog)
        assert jog.status is JogStatus.MOVING
        assert isinstance(move.error, MoveError)
        assert "an operator jogs the axis" in str(move.error)


def test_two_clients_need_two_leases() -> None:
    with operated() as desk, cat.attach(desk.share.name) as other:
        jog = desk.jog(100)
        with pytest.raises(cat.errors.LeaseError, match="is leased to process"):
            other.lease(axes=[0])
        desk.lease.release()  # also releases the jog
        desk.steps(100)
        assert jog.status is JogStatus.RELEASED
        with other.lease(axes=[0], for_=3600.0) as lease:
            second = lease.jog(0, -SPEED)
            desk.steps(300)  # heartbeats of the first client, which has no lease any more
            with pytest.raises(cat.errors.LeaseError):
                jog.beat()
            jog.release()  # not its press
            assert jog.status is JogStatus.REPLACED
            assert second.status is JogStatus.EXPIRED


def test_a_share_that_is_gone_and_back_forgets_the_jog() -> None:
    with own_name("again") as name, vertical_cell() as cell, cat.Share(name, jog=True) as share:
        arm = cell.drives(velocity_limit=1.0, deceleration_limit=DECELERATION)
        with cat.Loop(arm, sink=share) as loop, cat.attach(name) as reader:
            desk = Desk(cell, arm, loop, share, reader)
            desk.steps(200)
            old = desk.jog(100)
        assert not cell.powered
        with cat.Loop(arm, sink=share) as loop, cat.attach(name) as reader:
            with pytest.raises(cat.errors.LeaseError):
                old.beat()
            desk = Desk(cell, arm, loop, share, reader)
            desk.steps(200)
            assert not arm.jogged.any()
            desk.assert_at_rest()


@pytest.mark.parametrize("jog", [True, False])
def test_an_operator_gives_power_only_with_permission(jog: bool) -> None:
    with operated(jog=jog) as desk:
        desk.lease.request("disable")
        desk.steps(100)
        assert not desk.cell.powered
        request = desk.lease.request("enable", axes=[0])
        desk.steps(300)
        assert desk.cell.powered is jog
        assert request.status[0].name == ("TAKEN" if jog else "REFUSED_NOT_ALLOWED")
