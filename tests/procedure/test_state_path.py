"""Intermediate states of a state change."""

from __future__ import annotations

import pytest

from catenary.procedure.state_path import path
from catenary.wire.al import AlState

INIT, PRE_OP, SAFE_OP, OP, BOOT = (
    AlState.INIT,
    AlState.PRE_OP,
    AlState.SAFE_OP,
    AlState.OP,
    AlState.BOOT,
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
def test_path(now: AlState | None, target: AlState, between: tuple[AlState, ...]) -> None:
    assert path(now, target) == between
