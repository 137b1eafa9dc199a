from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from tests.gateway.line import Line


@pytest.fixture
def line() -> Iterator[Line]:
    """Yield a segment after its scan, with a gateway that lets clients write to the first servo."""
    with Line() as line, cat.Gateway(line.main, write=[1], port=0) as gateway:
        line.gateway = gateway
        yield line
