"""Requested states of axes from C, and the answers of the core."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.share.jog import STATES
from catenary.virtual import Segment, Servo
from tests.share.c.library import (
    ARGUMENT,
    DISABLE,
    ENABLE,
    LEASE_ENDED,
    QUICK_STOP,
    REFUSED,
    RESET,
    CError,
    CLease,
    Library,
)


class Rig:
    """Two enabled axes in a loop, and a lease of C on the second one."""

    def __init__(self, arm: cat.Drives, loop: cat.Loop, lease: CLease) -> None:
        self.arm, self.loop, self.lease = arm, loop, lease
        self.steps(5)

    def steps(self, cycles: int) -> None:
        for _ in range(cycles):
            next(self.loop)


@contextmanager
def rig_of(name: str, library: Library, *, jog: bool = True) -> Iterator[Rig]:
    with cat.MainDevice(Segment([Servo(), Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        stop = cat.StopPolicy(on_axis_stopped="event")
        with (
            cat.Share(name, jog=jog) as share,
            cat.Loop(arm, sink=share, stop=stop) as loop,
            library.attach(name) as reader,
        ):
            lease = reader.lease([1], duration=3600.0)
            yield Rig(arm, loop, lease)
            lease.release()


def test_axes_are_disabled_and_enabled(name: str, library: Library) -> None:
    with rig_of(name, library) as rig:
        assert rig.lease.request_status() == 0  # nothing was requested
        rig.lease.request(DISABLE)
        assert rig.lease.request_status() == 0
        rig.steps(50)
        assert rig.lease.request_status() == 1
        assert rig.arm.enabled.tolist() == [True, False]
        rig.lease.request(ENABLE)
        rig.steps(300)
        assert rig.lease.request_status() == 1
        assert rig.arm.enabled.all()


def test_quick_stop_acts_on_the_axes_of_the_lease(name: str, library: Library) -> None:
    with rig_of(name, library) as rig:
        rig.lease.request(QUICK_STOP)
        rig.steps(300)
        assert rig.arm.enabled.tolist() == [True, False]


def test_enabling_is_refused_where_the_program_does_not_allow_it(
    name: str, library: Library
) -> None:
    with rig_of(name, library, jog=False) as rig:
        rig.lease.request(ENABLE)
        rig.steps(50)
        with pytest.raises(CError, match=r"axis '1 .*' refuses .* jog=True") as caught:
            rig.lease.request_status()
        assert caught.value.code == REFUSED


def test_unknown_state_and_ended_lease_are_refused(name: str, library: Library) -> None:
    with rig_of(name, library) as rig, library.attach(name) as reader:
        for state in (-1, RESET + 1):
            with pytest.raises(CError, match="is not a state") as caught:
                rig.lease.request(state)
            assert caught.value.code == ARGUMENT
        late = reader.lease([0], duration=1e-9)
        with pytest.raises(CError, match="has ended") as caught:
            late.request(DISABLE)
        assert caught.value.code == LEASE_ENDED
        late.release()


def test_numbers_of_states_are_those_of_python() -> None:
    assert list(STATES.items()) == [
        ("disable", DISABLE),
        ("enable", ENABLE),
        ("quick_stop", QUICK_STOP),
        ("reset", RESET),
    ]
