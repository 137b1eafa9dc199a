"""What each fault does to whom: by this the witness tells what is excused."""

from __future__ import annotations

from collections.abc import Iterable

from catenary.bench.soak.cell import DEVICES, OPTIONAL
from catenary.virtual import Fault
from catenary.virtual import faults as f
from catenary.virtual.wiring import Neighbour

EVERYBODY = frozenset(range(DEVICES))
NOBODY: frozenset[int] = frozenset()


def isolated(fault: Fault) -> frozenset[int]:
    """Whom outputs do not reach while it is on."""
    match fault:
        case f.Cut():
            return behind(fault.between)
        case f.Unplug() | f.PowerCycle() | f.Swap():
            return from_on(fault.device)
        case f.Exchange():
            return from_on(min(fault.device, fault.other))
        case f.WrongWorkingCounter():
            return frozenset((fault.device,))
        case f.LoseFrames(way="out", n=None, every=1):
            return EVERYBODY
        case f.Corrupt(n=None, every=1):
            return behind(fault.between)
        case _:
            return NOBODY


def disturbs(fault: Fault) -> frozenset[int]:
    """Whose process data may be missing while it is on, without a frame being lost."""
    match fault:
        case f.Garble() | f.Delay() | f.Duplicate():
            return EVERYBODY
        case f.LeaveState() | f.RefuseState():
            return frozenset((fault.device,))
        case _:
            return isolated(fault)


def breaks_cable(fault: Fault) -> bool:
    """Whether frames can be lost by it that nobody spoils."""
    return isinstance(fault, (f.Cut, f.Join, f.Unplug, f.Replug, f.PowerCycle, f.Swap, f.Exchange))


def may_end(fault: Fault) -> bool:
    """Whether a loop may end by it: it hits frames, or a device that is required."""
    match fault:
        case f.LoseFrames() | f.Corrupt() | f.Garble() | f.Delay():
            return True
        case f.DriveFault() | f.SafeTorqueOff() | f.LeaveState() | f.Freeze():
            return fault.device not in OPTIONAL
        case _:
            return not isolated(fault) <= frozenset(OPTIONAL)


def mends(fault: Fault, earlier: Fault) -> bool:
    """Whether it ends an earlier one."""
    match fault, earlier:
        case f.Join(), f.Cut():
            return fault.between == earlier.between
        case f.Join(), f.Unplug():
            return fault.between[1] == earlier.device
        case f.Replug(), f.Unplug():
            return fault.device == earlier.device
        case f.Replug(), f.Cut():
            return fault.device == earlier.between[1]
        case _:
            return False


def places(faults: Iterable[Fault]) -> frozenset[int]:
    """Where something is taken away: what ends first would end both."""
    found: set[int] = set()
    for fault in faults:
        match fault:
            case f.Cut():
                found.add(min(behind(fault.between)))
            case f.Unplug() | f.PowerCycle() | f.Swap() | f.WrongWorkingCounter():
                found.add(fault.device)
            case f.Exchange():
                found |= {fault.device, fault.other}
            case _:
                pass
    return frozenset(found)


def behind(between: tuple[Neighbour, Neighbour]) -> frozenset[int]:
    return from_on(max(side for side in between if side != "main"))


def from_on(device: int) -> frozenset[int]:
    return frozenset(range(device, DEVICES))
