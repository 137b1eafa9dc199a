"""Trees from the ports that are open."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from catenary.model.topology import Place, Ports, open_ports, tree

END: Ports = (True, False, False, False)
LINE: Ports = (True, True, False, False)
FORK: Ports = (True, True, False, True)  # a coupler with E-bus at port 3 ... and cable at 1


def test_dl_status_tells_the_open_ports() -> None:
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
def test_whatever_the_ports_say_parents_come_before_their_children(ports: list[Ports]) -> None:
    for position, place in enumerate(tree(ports)):
        assert place.parent is None or place.parent < position
