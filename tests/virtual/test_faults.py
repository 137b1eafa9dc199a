"""Fault types: their fields, and errors that name the field."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from catenary.virtual import Servo
from catenary.virtual.faults import (
    Fault,
    corrupt,
    cut,
    delay,
    drift,
    lose_frames,
    mailbox_silent,
    power_cycle,
    refuse_state,
    swap,
)


def test_faults_are_values() -> None:
    assert lose_frames(3, at=2.0) == lose_frames(n=3, at=2.0, every=1, way="out")
    assert power_cycle(2, at=1.5, for_=0.8) != power_cycle(2, at=1.5)
    assert hash(cut(between=(4, 5), at=1.0)) == hash(cut(between=(4, 5), at=1.0))
    with pytest.raises(AttributeError):
        power_cycle(2).at = 1.0  # type: ignore[misc]


def test_number_of_affected_frames() -> None:
    assert lose_frames().frames == 1
    assert lose_frames(for_=0.1).frames is None
    assert lose_frames(5, for_=0.1).frames == 5


def test_fault_has_its_kind() -> None:
    assert power_cycle(2).kind == "power_cycle"
    assert repr(drift(1, ppm=20.0, at=1.0)) == "Drift(device=1, ppm=20.0, at=1.0, for_=None)"


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: lose_frames(0), "n must be at least 1"),
        (lambda: lose_frames(3, at=-1.0), "at must be at least 0"),
        (lambda: lose_frames(3, every=0), "every"),
        (lambda: lose_frames(3, way="up"), "way"),
        (lambda: lose_frames("3"), "n must be a finite number"),
        (lambda: cut(between=(4, 5), for_=0.0), "for must be above 0"),
        (lambda: cut(between=(4, 5), at=float("nan")), "at must be a finite number"),
        (lambda: power_cycle(-1), "device must be at least 0"),
        (lambda: refuse_state(2, "RUN", 0x1B), "state 'RUN'"),
        (lambda: refuse_state(2, 5, 0x1B), "state 5"),
        (lambda: refuse_state(2, "OP", 0), "code"),
        (lambda: delay(1, by=0.0), "by"),
        (lambda: drift(1, ppm=1e6), "ppm"),
    ],
)
def test_invalid_values_are_refused_with_the_field(make: Callable[[], Fault], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make()


def test_swap_contains_the_new_device() -> None:
    other = Servo(serial=7)
    assert swap(2, with_=other, at=1.0).with_ is other
    assert corrupt().between == ("main", 0)
    assert mailbox_silent(1).for_ is None
