"""Delays from the times at which a broadcast passed the ports.

`pass_through` is a frame on its way, written from the figure of ESC data sheet I §9.1.2: it knows
how long every cable is and tells what each port would have stamped.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.model.delays import PROCESSING_NS, ClockPlace, delays_ns
from catenary.model.topology import PORT_ORDER


@dataclass
class Node:
    """A device, the devices at its ports, and the delay of the cable before it [ns]."""

    cable: int = 100
    clock: bool = True
    zero: int = 0  # of its local time when the frame starts
    children: dict[int, Node] = field(default_factory=dict)


def pass_through(root: Node) -> tuple[list[ClockPlace], list[int]]:
    """Return the places with their time stamps, and the arrival time at each device."""
    places: list[ClockPlace] = []
    reached: list[int] = []

    def enter(node: Node, now: int, parent: int | None, port: int | None) -> int:
        position = len(places)
        reached.append(now)
        stamps = {0: now}
        now += PROCESSING_NS
        opened = (True, *(p in node.children for p in (1, 2, 3)))
        places.append(ClockPlace(parent, port, opened, None))  # type: ignore[arg-type]
        for onwards in PORT_ORDER:
            if onwards in node.children:
                child = node.children[onwards]
                now = enter(child, now + child.cable, position, onwards) + child.cable
                stamps[onwards] = now
        if node.clock:
            times = tuple((stamps.get(p, 0) + node.zero) % 2**32 for p in range(4))
            places[position] = replace(places[position], receive_times_ns=times)  # type: ignore[arg-type]
        return now

    enter(root, 0, None, None)
    return places, reached


def line(*nodes: Node) -> Node:
    for before, behind in itertools.pairwise(nodes):
        before.children[1] = behind
    return nodes[0]


def test_a_line() -> None:
    places, reached = pass_through(line(*(Node(cable=100 * k) for k in range(1, 6))))
    assert delays_ns([places]) == tuple(t - reached[0] for t in reached)
    assert reached == [0, 240, 580, 1020, 1560]  # cables and processing units


def test_local_times_with_any_origin_and_wrap_around() -> None:
    nodes = [Node(cable=700, zero=zero) for zero in (2**32 - 500, 2**32 - 1, 12345, 2**31)]
    places, _ = pass_through(line(*nodes))
    assert delays_ns([places]) == (0, 740, 1480, 2220)


def test_branches_follow_the_order_of_the_ports() -> None:
    """A junction: a frame passes port 3 first, then port 1, then port 2."""
    root = Node(children={3: line(Node(50), Node(60)), 1: Node(1000), 2: line(Node(5), Node(7))})
    places, reached = pass_through(root)
    assert delays_ns([places]) == tuple(reached)


def test_devices_without_clocks_count_as_cable() -> None:
    chain = line(Node(clock=False), Node(), Node(clock=False), Node(300), Node(clock=False))
    places, _ = pass_through(chain)
    assert delays_ns([places]) == (None, 0, None, 480, None)


def test_an_unknown_delay_is_distributed_evenly() -> None:
    """A coupler without a clock, one clock on each branch, equal cables."""
    coupler = Node(clock=False, children={3: Node(), 1: Node()})
    places, reached = pass_through(Node(children={1: coupler}))
    first, *_ = delays_ns([places])
    assert first == 0
    assert delays_ns([places])[2:] == pytest.approx(reached[2:], abs=PROCESSING_NS)


def test_several_first_clocks() -> None:
    root = Node(clock=False, children={3: line(Node(), Node(400)), 1: Node()})
    places, _ = pass_through(root)
    assert delays_ns([places]) == (None, 0, 440, 880)  # cables to and from the branch are unknown


def test_jitter_averages_out() -> None:
    places, _ = pass_through(line(Node(), Node(20), Node(20)))
    early = [replace(p, receive_times_ns=shifted(p, 0, +30)) for p in places]
    late = [replace(p, receive_times_ns=shifted(p, 0, -30)) for p in places]
    assert delays_ns([early, late]) == delays_ns([places]) == (0, 60, 120)


def shifted(place: ClockPlace, port: int, by: int) -> tuple[int, int, int, int]:
    times = list(place.receive_times_ns or ())
    times[port] = (times[port] + by) % 2**32
    return (times[0], times[1], times[2], times[3])


def test_no_measurement_is_refused() -> None:
    with pytest.raises(ValueError, match="measurement"):
        delays_ns([])


@st.composite
def trees(draw: st.DrawFn) -> Node:
    """Draw any tree of clocks, with cables of any length."""
    root = Node(zero=draw(st.integers(0, 2**32 - 1)))
    nodes = [root]
    for _ in range(draw(st.integers(0, 30))):
        parent = draw(st.sampled_from(nodes))
        free = [p for p in (1, 2, 3) if p not in parent.children]
        if free:
            node = Node(draw(st.integers(0, 5000)), zero=draw(st.integers(0, 2**32 - 1)))
            parent.children[draw(st.sampled_from(free))] = node
            nodes.append(node)
    return root


@given(trees())
def test_any_tree_of_clocks(root: Node) -> None:
    places, reached = pass_through(root)
    assert delays_ns([places]) == tuple(reached)


@given(
    st.lists(
        st.builds(
            ClockPlace,
            st.none(),
            st.none(),
            st.tuples(*[st.booleans()] * 4),
            st.none() | st.tuples(*[st.integers(0, 2**32 - 1)] * 4),
        ),
        max_size=20,
    )
)
def test_any_times_give_numbers(places: list[ClockPlace]) -> None:
    for place, delay in zip(places, delays_ns([places]), strict=True):
        assert (delay is None) == (place.receive_times_ns is None)
        assert delay is None or delay >= 0
