"""Receive times of one latch."""

from __future__ import annotations

import catenary as cat
from catenary.model.cable_delay import cable_delays_ns
from catenary.model.topology import make_topology
from catenary.procedure.receive_times import read_receive_times
from catenary.virtual import Junction


def test_the_cables_of_a_tree_are_measured() -> None:
    devices = [
        cat.virtual.Coupler(),
        Junction(),
        cat.virtual.Servo(),
        cat.virtual.Servo(),
        cat.virtual.DigitalOutputs(),
    ]
    with cat.MainDevice(cat.Segment(devices, behind={3: (1, 2)})) as main:
        descriptions = [sub.description for sub in main.passive_scan()]
        times = main.converse(read_receive_times(descriptions))
    assert times[4] is None  # no clock
    delays = cable_delays_ns(make_topology([d.open_ports for d in descriptions]), times)
    assert delays[0] is None
    assert delays[4] is None
    assert all(delay is not None and 100 < delay < 1000 for delay in delays[1:4])


def test_a_segment_without_clocks() -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.DigitalOutputs()])) as main:
        descriptions = [sub.description for sub in main.passive_scan()]
        sent = main.counts.sent
        assert main.converse(read_receive_times(descriptions)) == (None,)
        assert main.counts.sent == sent
