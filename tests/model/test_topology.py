"""Trees of devices from open ports."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.model.topology import Cable, Place, Ports, make_topology, open_ports, tree

END: Ports = (True, False, False, False)
LINE: Ports = (True, True, False, False)
FORK: Ports = (True, True, False, True)  # a coupler with E-bus at port 3 ... and cable at 1


def test_open_ports_of_dl_status() -> None:
    assert open_ports(0x0200) == (True, False, False, False)
    assert open_ports(0x0A00) == (True, True, False, False)
    assert open_ports(0x5530) == (False, False, False, False)  # links up, all loops closed


def test_a_line() -> None:
    assert tree([LINE, LINE, END]) == (Place(None, None), Place(0, 1), Place(1, 1))


def test_a_fork_fills_port_3_first_then_port_1() -> None:
    places = tree([FORK, LINE, END, END])
    assert places[1] == Place(0, 3)
    assert places[2] == Place(1, 1)
    assert places[3] == Place(0, 1)


@given(st.lists(st.tuples(*[st.booleans()] * 4), max_size=40))
def test_parents_precede_their_children_for_any_ports(ports: list[Ports]) -> None:
    for position, place in enumerate(tree(ports)):
        assert place.parent is None or place.parent < position


STAR: Ports = (True, True, True, True)  # a junction with all ports in use
LONE: Ports = (True, False, False, True)
SWAPPED_END: Ports = (False, True, False, False)


def test_a_line_has_a_cable_to_every_device() -> None:
    line = make_topology([LINE, LINE, END])
    assert line.contradictions == ()
    assert line.cables == (Cable(None, None, 0), Cable(0, 1, 1), Cable(1, 1, 2))
    assert line.cable_at(1, 1) == Cable(1, 1, 2)
    assert line.cable_at(2, 0) == Cable(1, 1, 2)
    assert line.cable_at(2, 1) is None


def test_a_star_of_lines() -> None:
    star = make_topology([LINE, STAR, LINE, END, END, LONE, END])
    assert star.contradictions == ()
    assert [(c.upper, c.upper_port, c.lower) for c in star.cables[1:]] == [
        (0, 1, 1),
        (1, 3, 2),
        (2, 1, 3),
        (1, 1, 4),
        (1, 2, 5),
        (5, 3, 6),
    ]
    assert [cable.lower for cable in star.children(1)] == [2, 4, 5]


def test_the_frame_returns_from_every_branch() -> None:
    fork = make_topology([FORK, LINE, END, END])
    assert fork.path() == ((0, 0), (1, 0), (2, 0), (1, 1), (0, 3), (3, 0), (0, 1))


def test_an_open_port_without_a_device_is_reported() -> None:
    [only] = make_topology([LINE, LINE]).contradictions
    assert only.startswith("device 1 port 1 is open, but no device answers behind it")


def test_the_open_port_of_a_ring_is_the_second_end() -> None:
    ring = make_topology([LINE, LINE, LINE], ring=True)
    assert ring.second_end == (2, 1)
    assert ring.contradictions == ()
    assert make_topology([LINE, LINE, END], ring=True).second_end is None
    assert len(make_topology([FORK, LINE, LINE], ring=True).contradictions) == 2


def test_a_cut_ring_reports_the_place() -> None:
    behind: Ports = (False, True, False, False)
    ring = make_topology([LINE, END, behind, LINE], ring=True)
    assert ring.contradictions == ("the ring is cut between device 1 and device 2",)
    assert ring.second_end == (3, 1)
    assert ring.cable_at(3, 0) == Cable(2, 1, 3)


def test_a_swapped_device_in_the_middle_is_reported() -> None:
    # in the order of wiring: 0, 2 with IN and OUT swapped, 1; device 1 processes a frame before 2
    [only] = make_topology([LINE, END, LINE]).contradictions
    assert only == (
        "device 2 has no place in the tree: no open port is left for it; its IN and OUT are "
        "swapped: devices behind it answer before it"
    )


def test_a_swapped_device_at_the_end_is_reported() -> None:
    [only] = make_topology([LINE, SWAPPED_END]).contradictions
    assert only == (
        "frames enter device 1 by port 1, and its port 0 is closed: its IN and OUT are swapped"
    )


def test_more_devices_than_ports() -> None:
    [only] = make_topology([END, END]).contradictions
    assert only.startswith("device 1 has no place")
    assert "scan again" in only


@st.composite
def trees(draw: st.DrawFn) -> tuple[list[Ports], list[Place]]:
    """Draw any tree of devices in the order of the frame, independently of the code."""
    ports: list[Ports] = []
    places: list[Place] = []

    def grow(parent: int | None, port: int | None, depth: int) -> None:
        position = len(ports)
        onwards = draw(st.sets(st.sampled_from((1, 2, 3)), max_size=3 if depth < 4 else 0))
        ports.append((True, 1 in onwards, 2 in onwards, 3 in onwards))
        places.append(Place(parent, port))
        for branch in (3, 1, 2):
            if branch in onwards:
                grow(position, branch, depth + 1)

    grow(None, None, 0)
    return ports, places


@given(trees())
def test_any_tree_is_reconstructed(grown: tuple[list[Ports], list[Place]]) -> None:
    ports, places = grown
    found = make_topology(ports)
    assert list(found.places) == places
    assert found.contradictions == ()
    arrivals = found.path()
    assert [position for position, port in arrivals if port == 0] == list(range(len(ports)))
    assert len(set(arrivals)) == len(arrivals) == 2 * len(ports) - 1


@given(st.lists(st.tuples(*[st.booleans()] * 4), max_size=40))
def test_contradictions_are_reported(ports: list[Ports]) -> None:
    found = make_topology(ports)
    open_ends = sum(sum(each[1:]) for each in ports) - (len(ports) - 1)
    if ports and (open_ends or not all(each[0] for each in ports)):
        assert found.contradictions
    assert len(found.path()) <= 2 * len(ports)


def test_cables_of_a_device_are_those_at_its_ports() -> None:
    ends, through = (True, False, False, False), (True, True, False, False)
    branches = (True, True, True, True)
    found = make_topology([through, branches, through, ends, ends, ends])
    for position in range(len(found)):
        expected = [each for each in found.cables if position in (each.upper, each.lower)]
        assert list(found.cables_of(position)) == expected
    assert [len(found.cables_of(position)) for position in range(6)] == [2, 4, 2, 1, 1, 1]
    assert list(found.cables_of(6)) == []
