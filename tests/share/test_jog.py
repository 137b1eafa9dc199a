"""Jogs, requested states and the stop: the API of a client, with a loop in virtual time."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import LeaseError, ShareError
from catenary.share import JogStatus, Lease, Reader, RequestStatus, Sweep
from catenary.share.command_table import MOTION, SLOT
from catenary.share.jog import JOG_TEXTS, REQUEST_TEXTS
from catenary.virtual import Segment, Servo
from tests.share.names import own_name
from tests.share.processes import started

LOOP = """
import sys
import catenary as cat
from catenary.virtual import Segment, Servo
with cat.MainDevice(Segment([Servo()])) as main:
    arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
    share = cat.Share(sys.argv[1], jog=True)
    with share, cat.Loop(arm, sink=share) as loop:
        for cycle in loop:
            if cycle.number == 100:
                print("running", flush=True)
"""
STOPPER = """
import sys
import catenary as cat
with cat.attach(sys.argv[1]) as arm:
    arm.stop()
    print("stopped", flush=True)
"""


class Rig:
    """Two enabled axes in a loop, and a client with a lease on the second one."""

    def __init__(self, arm: cat.Drives, loop: cat.Loop, reader: Reader, lease: Lease) -> None:
        self.arm, self.loop, self.reader, self.lease = arm, loop, reader, lease
        self.steps(5)

    def steps(self, cycles: int) -> None:
        for _ in range(cycles):
            next(self.loop)


@pytest.fixture
def rig() -> Iterator[Rig]:
    with own_name("jog") as name, cat.MainDevice(Segment([Servo(), Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        stop = cat.StopPolicy(on_axis_stopped="event")
        with (
            cat.Share(name, jog=True) as share,
            cat.Loop(arm, sink=share, stop=stop) as loop,
            cat.attach(name) as reader,
            reader.lease(axes=[1], for_=3600.0) as lease,
        ):
            yield Rig(arm, loop, reader, lease)


def test_the_words_have_the_layout_of_the_header_file() -> None:
    assert (MOTION.itemsize, SLOT.itemsize) == (128, 128)
    assert MOTION.fields is not None
    assert SLOT.fields is not None
    assert MOTION.fields["token"][1] == 64  # the cache line of the core
    assert SLOT.fields["answer"][1] == 64
    assert SLOT.fields["sweep_start"][1] == 104


def test_a_step_moves_one_axis_by_its_distance(rig: Rig) -> None:
    jog = rig.lease.jog(rig.arm.names[1], -0.5, distance=0.1)
    assert jog.status is JogStatus.NONE
    assert jog.axis == rig.arm.names[1]
    while not jog.status.over:
        jog.beat()
        rig.steps(1)
    assert jog.status is JogStatus.DONE
    assert rig.arm.target.position.tolist() == pytest.approx([0.0, -0.1], abs=1e-6)


def test_a_sweep_ends_by_itself(rig: Rig) -> None:
    jog = rig.lease.jog(1, 0.01, sweep=Sweep(start=4.0, end=20.0, duration=0.5))
    path = []
    while not jog.status.over:
        jog.beat()
        rig.steps(1)
        path.append(rig.arm.target.position[1])
    assert jog.status is JogStatus.DONE
    assert len(path) == pytest.approx(500, abs=5)
    half_wave = 0.01 / (math.pi * 4.0)
    assert 0.3 * half_wave < max(path) < half_wave


@pytest.mark.parametrize(
    "values",
    [
        (0.0, 1.0, 1.0),
        (1.0, -1.0, 1.0),
        (math.nan, 1.0, 1.0),
        (1.0, math.inf, 1.0),
        (1.0, 1.0, 0.1),
        (1.0, 1.0, math.nan),
    ],
)
def test_invalid_sweeps_raise(values: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must be finite and at least"):
        Sweep(*values)


def test_a_sweep_stays_below_half_of_the_cycle_rate(rig: Rig) -> None:
    with pytest.raises(ValueError, match="500 Hz: must be below half of the cycle rate, 500 Hz"):
        rig.lease.jog(1, 0.1, sweep=Sweep(1.0, 500.0, 1.0))


def test_the_block_of_a_jog_releases_it(rig: Rig) -> None:
    with rig.lease.jog(1, 0.5) as jog:
        rig.steps(50)
        assert rig.arm.jogged.tolist() == [False, True]
        assert rig.arm.enabled.tolist() == [True, False]
    rig.steps(400)
    assert jog.status is JogStatus.RELEASED
    assert rig.arm.enabled.all()


def test_the_release_of_a_lease_releases_its_jogs(rig: Rig) -> None:
    jog = rig.lease.jog(1, 0.5)
    rig.steps(50)
    rig.lease.release()
    rig.steps(100)
    assert jog.status is JogStatus.RELEASED
    with pytest.raises(LeaseError):
        jog.beat()
    with pytest.raises(LeaseError):
        rig.lease.jog(1, 0.5)


def test_an_echoed_token_extends_a_jog_until_it_is_old(rig: Rig) -> None:
    token = rig.reader.token
    assert 0 < token < 2**48
    jog = rig.lease.jog(1, 0.5, token=token)
    rig.steps(10)
    assert jog.status is JogStatus.MOVING
    for _ in range(300):
        jog.beat(token)
        rig.steps(1)
    assert jog.status.over
    assert jog.status is JogStatus.EXPIRED
    refused = rig.lease.jog(1, 0.5, token=token)
    rig.steps(2)
    assert refused.status is JogStatus.REFUSED_STALE
    assert refused.status.refused


def test_a_later_jog_replaces_the_status(rig: Rig) -> None:
    first = rig.lease.jog(1, 0.5)
    rig.steps(10)
    second = rig.lease.jog(1, 0.5)
    rig.steps(1)
    assert first.status is JogStatus.REPLACED
    assert second.status is JogStatus.REFUSED_MOVING


@pytest.mark.parametrize(
    ("velocity", "options"),
    [
        (0.0, {}),
        (math.nan, {}),
        (math.inf, {}),
        (0.1, {"distance": 0.0}),
        (0.1, {"distance": -1.0}),
        (0.1, {"distance": math.inf}),
        (0.1, {"acceleration": math.nan}),
        (0.1, {"acceleration": -1.0}),
        (0.1, {"token": 2**48}),
        (0.1, {"token": -1}),
        (0.1, {"distance": 0.1, "sweep": Sweep(1.0, 2.0, 1.0)}),
    ],
)
def test_invalid_values_raise_before_anything_is_written(
    rig: Rig, velocity: float, options: dict[str, object]
) -> None:
    with pytest.raises(ValueError, match="must be"):
        rig.lease.jog(1, velocity, **options)  # type: ignore[arg-type]
    rig.steps(5)
    assert not rig.arm.jogged.any()


def test_an_axis_without_a_lease_is_refused(rig: Rig) -> None:
    with pytest.raises(ValueError, match="is not part of this lease"):
        rig.lease.jog(0, 0.5)
    with pytest.raises(ValueError, match="is not part of this lease"):
        rig.lease.request("enable", axes=[0])


def test_requested_states(rig: Rig) -> None:
    request = rig.lease.request("disable")
    assert request.status == (RequestStatus.PENDING,)
    rig.steps(50)
    assert request.status == (RequestStatus.TAKEN,)
    assert rig.arm.enabled.tolist() == [True, False]
    rig.lease.request("enable")
    rig.steps(300)
    assert rig.arm.enabled.all()
    with pytest.raises(ValueError, match="must be one of disable, enable, quick_stop, reset"):
        rig.lease.request("faster")  # type: ignore[arg-type]


def test_the_event_names_the_process_that_stopped(rig: Rig) -> None:
    with started(STOPPER, rig.reader.layout.name) as program:
        assert program.line() == "stopped"
        pid = program.process.pid
    rig.steps(5)
    assert [str(reason.name) for reason in rig.arm.stopped if reason] == ["OPERATOR"] * 2
    events, _ = rig.reader.events()
    messages = [event.message for event in events if event.kind == "AxisStopped"]
    assert len(messages) == 2
    assert all(f"(process {pid})" in message for message in messages)


def test_the_layout_tells_if_jogs_are_accepted(rig: Rig) -> None:
    assert rig.reader.layout.jog is True


def test_a_loop_that_has_ended_cannot_be_stopped(rig: Rig) -> None:
    rig.loop.close()
    with cat.attach(rig.reader.layout.name) as late, pytest.raises(ShareError):
        late.stop()
    assert rig.lease.axes  # this reader has opened the desk of the loop
    with pytest.raises(ShareError, match="cannot be stopped"):
        rig.reader.stop()


def test_a_killed_loop_is_an_error_of_the_next_call(rig: Rig) -> None:
    """Its last answers stay in the desk: the status alone would be "moving" for ever."""
    with own_name("killed") as name, started(LOOP, name) as program:
        assert program.line() == "running"
        with cat.attach(name) as reader, reader.lease(for_=3600.0) as lease:
            jog = lease.jog(0, 0.5)
            program.kill()
            for call in (jog.beat, lambda: lease.jog(0, 0.5), lambda: lease.request("enable")):
                with pytest.raises(LeaseError, match="has died"):
                    call()
            with pytest.raises(ShareError, match="cannot be stopped"):
                reader.stop()


def test_an_application_that_enables_a_jogged_axis_does_not_disturb_the_jog(rig: Rig) -> None:
    jog = rig.lease.jog(1, 0.5)
    rig.steps(50)
    for _ in range(300):
        jog.beat()
        if not rig.arm.enabled.all():
            rig.arm.enable()
        rig.steps(1)
    assert jog.status is JogStatus.MOVING
    assert rig.arm.jogged.tolist() == [False, True]
    assert rig.arm.actual.position[1] > 0.1


def test_the_start_of_a_loop_does_not_wait_for_a_jogged_axis(rig: Rig) -> None:
    jog = rig.lease.jog(1, 0.5)
    rig.steps(50)
    rig.loop._opened.enable()
    assert jog.status is JogStatus.MOVING


def test_every_status_has_a_text() -> None:
    assert set(JOG_TEXTS) == set(JogStatus)
    assert set(REQUEST_TEXTS) == set(RequestStatus)
