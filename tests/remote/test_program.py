"""Which axes of a device count as powered, and checks before a procedure begins."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from catenary.errors import LoopError
from catenary.procedure.exchange import Procedure
from catenary.remote.program import Program, checked
from catenary.wire.cia402 import AxisState

DISABLED, ENABLED = 0, 1
DEVICE = 3


def program(state: int, requested: int, *, before: bool = False) -> Program:
    """Return a program with one axis. `before`: there is no cycle yet."""
    axis = SimpleNamespace(name="elbow", device=DEVICE)
    states, flags = np.array([state], np.uint8), np.array([requested << 6], np.uint8)
    newest = None if before else {"state": states, "axis_flags": flags}
    views = SimpleNamespace(  # of a program that has not iterated for some time
        axis_state=states if before else np.zeros(1, np.uint8),
        axis_flags=flags if before else np.zeros(1, np.uint8),
    )
    found = Program.__new__(Program)
    found.share = SimpleNamespace(newest=lambda: newest)  # type: ignore[assignment]
    found.network = SimpleNamespace(  # type: ignore[assignment]
        session=SimpleNamespace(views=views),
        plan=SimpleNamespace(cycle=SimpleNamespace(axes=[axis])),
    )
    return found


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize(
    ("state", "requested", "powered"),
    [
        (AxisState.OPERATION_ENABLED, ENABLED, True),
        (AxisState.OPERATION_ENABLED, DISABLED, True),
        (AxisState.QUICK_STOP_ACTIVE, DISABLED, True),
        (AxisState.FAULT_REACTION_ACTIVE, DISABLED, True),
        (AxisState.SWITCHED_ON, ENABLED, True),
        (AxisState.SWITCHED_ON, DISABLED, False),
        (AxisState.FAULT, DISABLED, False),
    ],
)
def test_an_axis_that_brakes_or_will_be_enabled_is_powered(
    state: int, requested: int, powered: bool, before: bool
) -> None:
    found = program(state, requested, before=before)
    assert found.powered_axes(DEVICE) == ["elbow"] * powered
    assert found.powered_axes(DEVICE + 1) == []


def test_a_check_runs_when_the_procedure_begins() -> None:
    enabled: list[str] = []

    def check() -> None:
        if enabled:
            raise LoopError("enabled meanwhile")

    def procedure() -> Procedure[int]:
        yield []
        return 7

    waiting = checked(check, procedure())
    enabled.append("elbow")
    with pytest.raises(LoopError):
        next(waiting)
