"""The engine's buffers, cut for each wish."""

import numpy as np

from catenary.loop.buffers import AXIS_BUFFERS, COLUMN_BUFFERS, bind_wishes
from catenary.plan.cycle import AxisPlan, Bank, Column, ImageArea, Number, NumberKind
from catenary.plan.wish import Views, WishTables

WORD = Number(0, 16, NumberKind.UNSIGNED)


class Bound:
    """A wish that remembers what it was given."""

    views: Views

    def bind(self, views: Views) -> None:
        self.views = views


def axis(name: str) -> AxisPlan:
    return AxisPlan(name, 0, 0, 0, 8, WORD, WORD)


def column(name: str, bank: Bank) -> Column:
    return Column(name, WORD, bank, 0, 0)


def buffers_of(tables: list[WishTables]) -> dict[str, memoryview]:
    """As the engine makes them: everything of all wishes, one behind the other."""
    n = sum(len(table.axes) for table in tables)
    sizes = dict.fromkeys(AXIS_BUFFERS, n)
    for (output, bank), name in COLUMN_BUFFERS.items():
        columns = [c for t in tables for c in (t.output_columns if output else t.input_columns)]
        sizes[name] = sum(c.bank is bank for c in columns)
    sizes["input_bytes"] = sum(area.size for t in tables for area in t.input_areas)
    sizes["output_bytes"] = sum(area.size for t in tables for area in t.output_areas)
    sizes["unit_valid"] = 2
    return {name: memoryview(np.arange(size, dtype=np.float64)) for name, size in sizes.items()}


def test_each_wish_gets_its_own_part() -> None:
    tables = [
        WishTables((axis("a"), axis("b")), (), (column("x", Bank.REAL),)),
        WishTables(
            (), (column("lamp", Bank.BIT),), (column("y", Bank.REAL), column("z", Bank.BIT))
        ),
        WishTables((axis("c"),), (column("valve", Bank.BIT),), ()),
    ]
    wishes = [Bound(), Bound(), Bound()]
    whole = bind_wishes(wishes, tables, buffers_of(tables), lambda: True)  # type: ignore[arg-type]
    arm, io, last = (wish.views for wish in wishes)
    assert arm.actual_position.tolist() == [0, 1]
    assert last.target_torque.tolist() == [2]
    assert (arm.input_reals.tolist(), io.input_reals.tolist()) == ([0], [1])
    assert io.input_bits.tolist() == [0]
    assert (io.output_bits.tolist(), last.output_bits.tolist()) == ([0], [1])
    assert io.goal.size == 0
    last.goal[0] = 7
    assert whole.goal.tolist() == [0, 1, 7]


def test_views_are_no_copies() -> None:
    tables = [WishTables((axis("a"),))]
    wish = Bound()
    buffers = buffers_of(tables)
    bind_wishes([wish], tables, buffers, lambda: True)  # type: ignore[list-item]
    wish.views.target_position[0] = 1.5
    assert buffers["target_position"][0] == 1.5


def test_areas_of_two_wishes_lie_one_after_the_other() -> None:
    first = ImageArea("a", 8, 3, 0, 0, bytes(3))
    second = ImageArea("b", 0, 2, 1, 0, bytes(2))
    tables = [WishTables(output_areas=(first,)), WishTables(output_areas=(second,))]
    wishes = [Bound(), Bound()]
    whole = bind_wishes(wishes, tables, buffers_of(tables), lambda: True)  # type: ignore[arg-type]
    assert [wish.views.output_bytes.tolist() for wish in wishes] == [[0, 1, 2], [3, 4]]
    assert whole.output_bytes.size == 5
    assert whole.input_bytes.size == 0
