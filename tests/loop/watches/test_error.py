"""Watch of the error counters, with simulated answers."""

from __future__ import annotations

from collections.abc import Callable

import catenary as cat
from catenary.bus.event_types import FaultFound
from catenary.loop.watches.error import ErrorWatch
from catenary.procedure.exchange import After, Reply, Request
from catenary.virtual import Coupler, Segment, Servo
from catenary.wire.register import ERROR_COUNTERS

SIZE = ERROR_COUNTERS.size
Answer = Callable[[Request], Reply]


def quiet(request: Request) -> Reply:
    return Reply(bytes(SIZE), 1)


def twice(request: Request) -> Reply:
    return Reply(bytes(SIZE), 2)


def invalid_at_port_0(request: Request) -> Reply:
    return Reply(b"\x40" + bytes(SIZE - 1), 1)


def play(main: cat.MainDevice, *answers: Answer) -> None:
    """One look after the other."""
    watch = ErrorWatch(main, now=lambda: 1.0).run()
    step = next(watch)
    for answer in answers:
        assert isinstance(step, list)
        pause = watch.send([answer(request) for request in step])
        assert isinstance(pause, After)
        step = watch.send([])


def test_it_continues_if_two_devices_have_the_same_address() -> None:
    """Somebody joined with an old station address: that is no reason to be blind from then on."""
    with cat.MainDevice(Segment([Coupler(), Servo()])) as main:
        main.scan()
        play(main, quiet, twice, invalid_at_port_0)
        assert any(isinstance(event, FaultFound) for event in main.events)
