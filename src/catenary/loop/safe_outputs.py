"""Safe values of outputs, which a loop sends at its end, before the devices leave OP.

The areas of process data have chosen values. The destinations of copies between devices become 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from catenary.core import CYCLE_NONE, CYCLE_STOPPED
from catenary.errors import LoopError
from catenary.loop.signals import SignalGuard
from catenary.plan.cycle import CyclePlan
from catenary.plan.request import Views

# Longest wait for an exchange with safe outputs: the longer of these two times.
TIMEOUT_NS = 100_000_000
EXCHANGES = 5


def make_safe(plan: CyclePlan, views: Views) -> None:
    """Set the bytes of all areas to their safe values. The next cycle sends them.

    Args:
        plan: Plan of the cycle.
        views: All private buffers.
    """
    safe = b"".join(area.safe for area in plan.output_areas)
    views.output_bytes[:] = np.frombuffer(safe, np.uint8)


def confirm_safe(
    plan: CyclePlan, views: Views, cycle: Callable[[], int], guard: SignalGuard
) -> None:
    """Run cycles until the devices with safe outputs have received them.

    Args:
        plan: Plan of the cycle.
        views: All private buffers.
        cycle: Runs a cycle and returns its flags.
        guard: Signal handlers; a second signal shortens the wait.

    Raises:
        LoopError: A required device did not answer in time.
    """
    places = [(area.sync_unit, f"device {area.name}") for area in plan.output_areas]
    places += [(copy.sync_unit, f"device {copy.device}") for copy in plan.copies]
    if not places:
        return
    units = {unit for unit, _ in places}
    missing = required = {unit for unit in units if not plan.sync_units[unit].optional}
    # One exchange may be in progress, and a law that ends has prepared the next one.
    turn = max(plan.sync_units[unit].divider for unit in units) + 3
    for done in range(max(TIMEOUT_NS // plan.period_ns, EXCHANGES * turn)):
        if cycle() & (CYCLE_STOPPED | CYCLE_NONE):
            missing = required
            break
        missing = {unit for unit in required if not views.unit_valid[unit]}
        if done + 1 >= turn and (not missing or guard.hurry):
            return
    if not missing:
        return
    names = ", ".join(dict.fromkeys(name for unit, name in places if unit in missing))
    raise LoopError(
        f"{names} did not confirm the safe values of its outputs",
        hint="a device that answers has received them, even if another device of its sync unit is "
        "silent; the outputs of a silent device depend on its watchdog",
    )
