"""Rows of several blocks in one."""

import numpy as np
import pytest

from catenary import control


def test_parts_are_found_again_as_views() -> None:
    row = control.join([1.0, 2.0], [], np.array([[3.0, 4.0], [5.0, 6.0]]))
    assert control.part(row, 0).tolist() == [1.0, 2.0]
    assert control.part(row, 1).tolist() == []
    assert control.part(row, 2).tolist() == [3.0, 4.0, 5.0, 6.0]
    control.part(row, 2)[0] = 7.0
    assert control.part(row, 2)[0] == 7.0


@pytest.mark.parametrize("k", [-1, 2])
def test_a_part_that_is_not_there(k: int) -> None:
    with pytest.raises(IndexError, match="no such part"):
        control.part(control.join([1.0], [2.0]), k)


def test_an_axis_begins_anew_and_leaves_the_others() -> None:
    memory = np.arange(1.0, 7.0)
    control.restart(memory, 1, 3)
    assert memory.tolist() == [1.0, 2.0, 0.0, 0.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"proportional": [1.0, 2.0]}, "proportional: one value, or one for each of 3 axes"),
        ({"proportional": [1.0, float("nan"), 1.0]}, "proportional of axis 1: nan"),
        ({"proportional": 1.0, "limit": 0.0}, "limit of axis 0: 0.0, must be above 0.0"),
        ({"proportional": 1.0, "integral": [1, 1, -1]}, "integral of axis 2: -1.0"),
    ],
)
def test_a_wrong_number_is_refused_where_it_is_written(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        control.Pid(3, **options)
