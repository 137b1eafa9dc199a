"""A loop over two networks serves each with the share of this network."""

from __future__ import annotations

import catenary as cat
from catenary.realtime import VirtualClock
from catenary.remote import connect
from catenary.virtual import Segment
from catenary.virtual.devices import Servo
from tests.share.names import own_name


def test_each_network_has_a_service() -> None:
    clock = VirtualClock()
    segments = [Segment([Servo()], clock=clock), Segment([Servo(), Servo()], clock=clock)]
    with (
        own_name("upper") as upper,
        own_name("lower") as lower,
        cat.MainDevice(segments[0]) as one,
        cat.MainDevice(segments[1]) as two,
        cat.Share(upper) as first,
        cat.Share(lower) as second,
    ):
        arms = [
            cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
            for main in (one, two)
        ]
        with (
            cat.Loop(*arms, period=1e-3, sink=[first, second]),
            connect(upper) as up,
            connect(lower) as low,
        ):
            assert (up.hello().networks, low.hello().networks) == (2, 2)
            assert [axis.network for axis in up.axes()] == [0]
            assert [axis.network for axis in low.axes()] == [1, 1]
