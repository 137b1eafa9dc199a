"""Foreign programs that judge us, over a pair of network interfaces."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from catenary.realtime.child import start_python


@pytest.fixture
def served(veth: tuple[str, str]) -> Iterator[str]:
    """The interface on which the demo's segment answers."""
    ours, theirs = veth
    with start_python(["-m", "catenary.cli", "virtual", "serve", theirs]) as server:
        assert server.read_line(20.0), "the virtual segment did not start"
        yield ours
