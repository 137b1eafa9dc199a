"""Which states lie between two."""

from __future__ import annotations

import pytest

from catenary.procedure.state_path import path
from catenary.wire.al import State

INIT, PRE_OP, SAFE_OP, OP, BOOT = (
    State.INIT,
    State.PRE_OP,
    State.SAFE_OP,
    State.OP,
    State.BOOT,
)


@pytest.mark.parametrize(
    ("now", "target", "between"),
    [
        (INIT, OP, (PRE_OP, SAFE_OP, OP)),
        (PRE_OP, SAFE_OP, (SAFE_OP,)),
        (OP, PRE_OP, (PRE_OP,)),
        (OP, INIT, (INIT,)),
        (PRE_OP, PRE_OP, (PRE_OP,)),
        (PRE_OP, BOOT, (INIT, BOOT)),
        (BOOT, BOOT, (BOOT,)),
        (BOOT, PRE_OP, (INIT, PRE_OP)),
        (BOOT, INIT, (INIT,)),
        (INIT, BOOT, (BOOT,)),
        (None, PRE_OP, (INIT, PRE_OP)),
        (None, INIT, (INIT,)),
    ],
)
def test_path(now: State | None, target: State, between: tuple[State, ...]) -> None:
    assert path(now, target) == between
