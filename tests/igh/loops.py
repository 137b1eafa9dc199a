"""Loops on the double of libethercat."""

from __future__ import annotations

import catenary as cat
from catenary.igh import KernelMaster
from tests.loop_options import grouped


def clocked_loop(main: cat.MainDevice, **options: object) -> cat.Loop:
    """Return a loop of all drives, with distributed clocks."""
    arm = cat.Drives(main.subs.drives, counts_per_turn=1000, velocity_limit=100.0, dc=True)
    return cat.Loop(arm, **grouped(options))


def kernel_of(main: cat.MainDevice) -> KernelMaster:
    """Return the kernel master of a MainDevice on one."""
    assert isinstance(main.master, KernelMaster)
    return main.master
