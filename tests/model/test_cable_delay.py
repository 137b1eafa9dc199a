"""Cable delays from one latch. The times are computed by following a frame through a tree."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.model.cable_delay import cable_delays_ns
from catenary.model.delays import TIME_SPAN, PortTimes
from catenary.model.topology import Topology, make_topology, open_ports
from tests.model.tables import END, LINE, STAR, line


def walk(topology: Topology, ways: list[int], starts: list[int]) -> list[PortTimes]:
    """Return the receive times of a frame.

    `ways[n]` is the one-way delay to device n, and `starts[n]` is the origin of its clock.
    """
    now = 1000
    times = [[0, 0, 0, 0] for _ in ways]

    def pass_through(position: int) -> None:
        nonlocal now
        times[position][0] = now
        for cable in topology.children(position):
            now += ways[cable.lower]
            pass_through(cable.lower)
            now += ways[cable.lower]
            times[position][cable.upper_port or 0] = now

    pass_through(0)
    made: list[PortTimes] = []
    for each, start in zip(times, starts, strict=True):
        one, two, three, four = ((time + start) % TIME_SPAN for time in each)
        made.append((one, two, three, four))
    return made


TREE = make_topology([LINE, STAR, LINE, END, END, END])
WAYS = [0, 300, 150, 400, 1000, 70]


def test_a_line() -> None:
    topology = make_topology(line(4))
    times = walk(topology, [0, 300, 150, 20], [0, 0, 0, 0])
    assert cable_delays_ns(topology, times) == (None, 300, 150, 20)


def test_delays_of_branches() -> None:
    times = walk(TREE, WAYS, [0] * 6)
    assert cable_delays_ns(TREE, times) == (None, *WAYS[1:])


@given(st.lists(st.integers(0, TIME_SPAN - 1), min_size=6, max_size=6))
def test_clocks_with_any_origin_and_wrap_around(starts: list[int]) -> None:
    assert cable_delays_ns(TREE, walk(TREE, WAYS, starts)) == (None, *WAYS[1:])


def test_a_device_without_a_clock_has_no_delay() -> None:
    times: list[PortTimes | None] = [*walk(TREE, WAYS, [0] * 6)]
    times[2] = None
    assert cable_delays_ns(TREE, times) == (None, 300, None, None, 1000, 70)


def test_impossible_times_give_no_delay() -> None:
    topology = make_topology(line(2))
    assert cable_delays_ns(topology, [(0, 10, 0, 0), (0, 0, 0, 0)]) == (None, 5)
    third = make_topology(line(3))
    assert cable_delays_ns(third, [(0, 10, 0, 0), (0, 500, 0, 0), (0, 0, 0, 0)])[1] is None


def test_a_recorded_coupler_with_two_terminals() -> None:
    """EK1100, EL2828, EL2889 in ethercrab's tests/replay-dc.pcapng: DL status and receive times.
    The EL2889 has no clock."""
    topology = make_topology([open_ports(word) for word in (0x5A31, 0x5A33, 0x5613)])
    assert topology.contradictions == ()
    coupler = (0x3C620F52, 0x3C6211AA, 0, 0)
    terminal = (0x3D0BD6AE, 0x3D0BD7E4, 0, 0)
    assert cable_delays_ns(topology, [coupler, terminal, None]) == (None, 145, None)
