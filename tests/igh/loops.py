"""Loops on the double of libethercat."""

from __future__ import annotations

import catenary as cat
from tests.loop_options import grouped


def clocked_loop(main: cat.MainDevice, **options: object) -> cat.Loop:
    """Return a loop of all drives, with distributed clocks."""
    arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, dc=True)
    return cat.Loop(arm, **grouped(options))
