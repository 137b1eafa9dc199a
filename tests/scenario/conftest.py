from collections.abc import Iterator

import pytest

from tests.scenario.cell import Cell, cell_of


@pytest.fixture
def cell() -> Iterator[Cell]:
    """Yield a cell of a coupler, lamps and two servos."""
    with cell_of() as cell:
        yield cell
