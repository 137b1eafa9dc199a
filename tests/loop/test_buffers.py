"""Buffers of the engine, divided into views for each request."""

import numpy as np

from catenary.loop.buffers import AXIS_BUFFERS, COLUMN_BUFFERS, bind_requests
from catenary.plan.cycle import AxisPlan, Bank, Column, ImageArea, Number, NumberKind
from catenary.plan.request import RequestTables, Views

WORD = Number(0, 16, NumberKind.UNSIGNED)


class Bound:
    """A request that remembers what it was given."""

    views: Views

    def bind(self, views: Views) -> None:
        self.views = views


def axis(name: str) -> AxisPlan:
    return AxisPlan(name, 0, 0, 0, 8, WORD, WORD)


def column(name: str, bank: Bank) -> Column:
    return Column(name, WORD, bank, 0, 0)


def buffers_of(tables: list[RequestTables]) -> dict[str, memoryview]:
    """As the engine makes them: everything of all requests, one behind the other."""
    n = sum(len(table.axes) for table in tables)
    sizes = dict.fromkeys(AXIS_BUFFERS, n)
    for (output, bank), name in COLUMN_BUFFERS.items():
        columns = [c for t in tables for c in (t.output_columns if output else t.input_columns)]
        sizes[name] = sum(c.bank is bank for c in columns)
    sizes["input_bytes"] = sum(area.size for t in tables for area in t.input_areas)
    sizes["output_bytes"] = sum(area.size for t in tables for area in t.output_areas)
    sizes["unit_valid"] = 2
    return {name: memoryview(np.arange(size, dtype=np.float64)) for name, size in sizes.items()}


def test_each_request_gets_its_own_part() -> None:
    tables = [
        RequestTables((axis("a"), axis("b")), (), (column("x", Bank.REAL),)),
        RequestTables(
            (), (column("lamp", Bank.BIT),), (column("y", Bank.REAL), column("z", Bank.BIT))
        ),
        RequestTables((axis("c"),), (column("valve", Bank.BIT),), ()),
    ]
    requests = [Bound(), Bound(), Bound()]
    whole = bind_requests(requests, tables, buffers_of(tables), lambda: True)  # type: ignore[arg-type]
    arm, io, last = (request.views for request in requests)
    assert arm.actual_position.tolist() == [0, 1]
    assert last.target_torque.tolist() == [2]
    assert (arm.input_reals.tolist(), io.input_reals.tolist()) == ([0], [1])
    assert io.input_bits.tolist() == [0]
    assert (io.output_bits.tolist(), last.output_bits.tolist()) == ([0], [1])
    assert io.requested_state.size == 0
    last.requested_state[0] = 7
    assert whole.requested_state.tolist() == [0, 1, 7]


def test_views_are_no_copies() -> None:
    tables = [RequestTables((axis("a"),))]
    request = Bound()
    buffers = buffers_of(tables)
    bind_requests([request], tables, buffers, lambda: True)  # type: ignore[list-item]
    request.views.target_position[0] = 1.5
    assert buffers["target_position"][0] == 1.5


def test_areas_of_two_requests_lie_one_after_the_other() -> None:
    first = ImageArea("a", 8, 3, 0, 0, bytes(3))
    second = ImageArea("b", 0, 2, 1, 0, bytes(2))
    tables = [RequestTables(output_areas=(first,)), RequestTables(output_areas=(second,))]
    requests = [Bound(), Bound()]
    whole = bind_requests(requests, tables, buffers_of(tables), lambda: True)  # type: ignore[arg-type]
    assert [request.views.output_bytes.tolist() for request in requests] == [[0, 1, 2], [3, 4]]
    assert whole.output_bytes.size == 5
    assert whole.input_bytes.size == 0
