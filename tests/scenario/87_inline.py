"""An inline loop sends nothing while the application computes. Only the watchdog of the devices
acts: after 10 ms in CST, after 100 ms in CSP. Until then the drive applies its last torque.
The drive then reacts as its 0x6007 says, and the brake closes.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.errors import CatenaryError
from tests.scenario.vertical import (
    LOAD,
    MS,
    RESOLUTION,
    Trace,
    VerticalCell,
    follow,
    vertical_cell,
)

WATCHDOG = {"cst": 0.010, "csv": 0.100, "csp": 0.100}  # s, the defaults
SERVICE = 2 * MS  # from the watchdog to the drive's reaction


def stuck(cell: VerticalCell, mode: str, torque: float = LOAD) -> tuple[Trace, float, float]:
    """Let the body of an inline loop compute for a second.

    Returns the trace, and angle [rad] and velocity downwards [rad/s] before.
    """
    arm = cell.drives(mode=mode, velocity_limit=6.0)
    with pytest.raises(CatenaryError, match="SAFE-OP"), cat.Loop(arm, execution="inline") as loop:
        follow(cell, arm, loop, 100)
        arm.target.torque[:] = torque
        cycle = next(loop)
        before, downwards = cell.joint, -cell.velocity
        frames = cell.link.seen(traffic="cyclic")
        trace = cell.compute(cycle, 1.0)
        assert cell.link.seen(traffic="cyclic") <= frames + 1
        for _ in range(5):  # until the answer to the first frame since then is there
            next(loop)
    return trace, before, downwards


@pytest.mark.parametrize("torque", [LOAD, 15.0, 35.0])
def test_in_cst_the_torque_lasts_as_long_as_the_watchdog(torque: float) -> None:
    """Bound: the way with the kept torque, the drive's ramp (0x605E), the fall until the brake has
    closed."""
    with vertical_cell() as cell:
        trace, before, downwards = stuck(cell, "cst", torque)
        seconds = WATCHDOG["cst"] + SERVICE
        if torque == LOAD:
            assert WATCHDOG["cst"] - MS <= trace.powered_ms * MS <= seconds
        kept = cell.kept_torque(torque, seconds + MS, downwards)
        assert trace.fall(before) < kept.ramp_bound() + cell.fall_bound() + RESOLUTION


@pytest.mark.parametrize("mode", ["csp", "csv"])
def test_in_csp_and_csv_the_drive_holds_until_the_watchdog(mode: str) -> None:
    with vertical_cell() as cell:
        trace, before, _ = stuck(cell, mode)
        assert WATCHDOG[mode] - MS <= trace.powered_ms * MS <= WATCHDOG[mode] + SERVICE
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION
