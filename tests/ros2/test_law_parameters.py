"""Parameters of the running law as parameters of the node."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import ShareError
from catenary.remote.messages import LawEntry
from catenary.remote.messages import Parameter as LawParameter
from catenary.ros2.backend import Parameter
from catenary.ros2.law_parameters import NodeLawParameters, node_parameters
from catenary.ros2.requests import Requests
from tests.record.beside import until
from tests.remote.programs import Running, program
from tests.ros2.memory_backend import MemoryBackend

STIFFNESS, DAMPING = "impedance.stiffness", "impedance.damping"
TIMEOUT = 60.0


def impedance(target, parameters):  # type: ignore[no-untyped-def]
    target.position[0] = 0.0 * parameters[0]


class Node:
    """A node in memory with the parameters of a loop in the background."""

    def __init__(self, running: Running) -> None:
        limited = cat.Parameter("stiffness", 0, 40, "N·m/rad")
        law = cat.law(parameters=[limited, "damping"])(impedance)
        self.run = running.loop.start(law, parameters=[1.0, 2.0])
        self.backend = MemoryBackend()
        self.it = NodeLawParameters(self.backend, Requests(running.name, None, TIMEOUT))

    def value(self, name: str) -> float | None:
        """Return the shown value of a parameter, after a report."""
        self.it._ask_at = 0.0
        self.it.step()
        found = self.backend.declared.get(name)
        return found.value if found is not None else None

    def change(self, **values: object) -> str:
        return self.backend.change({f"impedance.{name}": each for name, each in values.items()})


@pytest.fixture
def node() -> Iterator[Node]:
    pytest.importorskip("numba")
    with program() as running:
        made = Node(running)
        try:
            assert until(lambda: made.value(STIFFNESS) == 1.0)
            yield made
        finally:
            made.it.close()


def test_parameters_have_range_and_unit(node: Node) -> None:
    assert node.backend.declared == {
        STIFFNESS: Parameter(1.0, 0.0, 40.0, "[N·m/rad]"),
        DAMPING: Parameter(2.0),
    }


def test_a_request_changes_the_law_at_once(node: Node) -> None:
    assert node.change(stiffness=3.0, damping=4.0) == ""
    assert node.run.parameters.tolist() == [3.0, 4.0]
    assert until(lambda: node.value(STIFFNESS) == 3.0)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (41.0, "outside of its range 0 to 40 N·m/rad"),
        (math.nan, "is not a finite number"),
        (3, "needs a floating-point number, not 3"),
        (None, "needs a floating-point number, not None"),
    ],
)
def test_a_refused_request_changes_nothing(node: Node, value: object, reason: str) -> None:
    assert reason in node.change(damping=5.0, stiffness=value)
    assert node.run.parameters.tolist() == [1.0, 2.0]


def test_changes_of_other_programs_are_shown(node: Node) -> None:
    node.run.parameters = [7.0, 8.0]
    assert until(lambda: node.value(STIFFNESS) == 7.0)
    assert node.value(DAMPING) == 8.0


def test_a_report_from_before_a_change_is_discarded(node: Node) -> None:
    node.it._ask_at = 0.0
    node.it.step()
    assert node.change(stiffness=9.0) == ""
    assert node.it._asked is None
    assert until(lambda: node.value(STIFFNESS) == 9.0)


def test_a_law_that_has_ended_refuses(node: Node) -> None:
    node.run.stop()
    assert until(lambda: not node.run.running)
    assert node.change(stiffness=3.0) == "the law 'impedance' does not run"


def test_a_request_for_two_laws_is_refused(node: Node) -> None:
    node.it._places["other.gain"] = "other", "gain"
    refusal = node.backend.change({STIFFNESS: 1.0, "other.gain": 1.0})
    assert refusal == "one request sets parameters of one law, not of impedance, other"


def test_without_a_loop_a_request_is_refused_with_the_reason() -> None:
    it = NodeLawParameters(backend := MemoryBackend(), Requests("test-gone", None, TIMEOUT))
    it._places[STIFFNESS] = "impedance", "stiffness"
    assert "no program serves requests" in backend.change({STIFFNESS: 1.0})
    it.step()
    assert it._asked is not None
    assert isinstance(it._asked.exception(), ShareError)
    it.step()
    assert backend.declared == {}
    it.close()


def test_a_list_of_numbers_is_not_shown() -> None:
    entry = LawParameter(value=[1.0, 2.0], minimum=None, maximum=None, unit="")
    assert node_parameters([LawEntry(name="l", running=True, parameters={"p": entry})]) == {}
