"""Effects of faults on devices. The witness excuses no other effects."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.soak.cell import DEVICES, OPTIONAL
from catenary.virtual import Fault
from catenary.virtual import faults as f
from catenary.virtual.wiring import Neighbour

ALL_DEVICES = frozenset(range(DEVICES))
NO_DEVICE: frozenset[int] = frozenset()


def out_of_reach(faults: Iterable[Fault], *, ring: bool) -> frozenset[int]:
    """Return the devices that receive no outputs while all these faults are active."""
    cables: set[int] = set()  # broken, by number
    gone: set[int] = set()  # devices without power
    deaf: set[int] = set()
    spoilt: list[int] = []  # cables on which each frame is corrupted
    for fault in faults:
        match fault:
            case f.Cut() | f.Unplug():
                cables.add(cable_of(fault))
            case f.PowerCycle() | f.Swap():
                gone.add(fault.device)
            case f.Exchange():
                gone |= {fault.device, fault.other}
            case f.WrongWorkingCounter():
                deaf.add(fault.device)
            case f.LoseFrames(way="out", n=None, every=1):
                return ALL_DEVICES
            case f.Corrupt(n=None, every=1):
                spoilt.append(cable_between(fault.between))
            case _:
                pass
    first = min(cables | gone, default=DEVICES)  # the first end reaches the devices before it
    reached = set(range(min([first, *spoilt])))
    if ring and first < DEVICES:
        second = max(cables | {device + 1 for device in gone})
        # Frames are processed on their way back from the gap: after each cable of this side.
        if not any(cable > second for cable in spoilt):
            reached |= set(range(second, DEVICES))
    return ALL_DEVICES - (reached - deaf)


def disturbed(faults: Iterable[Fault], *, ring: bool) -> frozenset[int]:
    """Return the devices whose process data may be missing although no frame is lost."""
    faults = tuple(faults)
    found = set(out_of_reach(faults, ring=ring))
    for fault in faults:
        match fault:
            case f.Garble() | f.Delay() | f.Duplicate():
                return ALL_DEVICES
            case f.LoseFrames(every=2) | f.Corrupt(every=2) if ring:
                return ALL_DEVICES  # it always hits the same one of a frame's two copies
            case f.LeaveState() | f.RefuseState():
                found.add(fault.device)
            case _:
                found |= out_of_reach([fault], ring=ring)
    return frozenset(found)


def breaks_cable(fault: Fault) -> bool:
    """Return True if the fault can lose frames in flight."""
    return isinstance(fault, (f.Cut, f.Join, f.Unplug, f.Replug, f.PowerCycle, f.Swap, f.Exchange))


def may_end(faults: Iterable[Fault], *, ring: bool) -> bool:
    """Return True if these faults may end a loop: they hit frames or a required device."""
    faults = tuple(faults)
    together = out_of_reach(faults, ring=ring)
    return not together <= frozenset(OPTIONAL) or any(map(_may_end_alone, faults))


def _may_end_alone(fault: Fault) -> bool:
    match fault:
        case f.LoseFrames() | f.Corrupt() | f.Garble() | f.Delay():
            return True
        case f.DriveFault() | f.SafeTorqueOff() | f.LeaveState() | f.Freeze():
            return fault.device not in OPTIONAL
        case _:
            return False


def fits(drawn: Iterable[Fault], others: Iterable[Fault], *, ring: bool) -> bool:
    """Return True if faults may be active together with others.

    Faults at the same place may not, because the first end would end both. In a ring, two gaps may
    isolate only optional devices.
    """
    drawn, others = tuple(drawn), tuple(others)
    if places(drawn) & places(others):
        return False
    if not ring:
        return True
    alone = out_of_reach(drawn, ring=ring) | out_of_reach(others, ring=ring)
    return out_of_reach((*drawn, *others), ring=ring) - alone <= frozenset(OPTIONAL)


def mends(fault: Fault, earlier: Fault) -> bool:
    """Return True if a fault ends an earlier one."""
    return (
        isinstance(fault, (f.Join, f.Replug))
        and isinstance(earlier, (f.Cut, f.Unplug))
        and cable_of(fault) == cable_of(earlier)
    )


def places(faults: Iterable[Fault]) -> frozenset[int]:
    """Return the numbers of the cables and devices that the faults interrupt."""
    found: set[int] = set()
    for fault in faults:
        match fault:
            case f.Cut() | f.Unplug():
                found.add(cable_of(fault))
            case f.PowerCycle() | f.Swap() | f.WrongWorkingCounter():
                found.add(fault.device)
            case f.Exchange():
                found |= {fault.device, fault.other}
            case _:
                pass
    return frozenset(found)


def cable_of(fault: f.Cut | f.Join | f.Unplug | f.Replug) -> int:
    """Return the number of the fault's cable."""
    if isinstance(fault, (f.Unplug, f.Replug)):
        return fault.device
    return cable_between(fault.between)


def cable_between(between: tuple[Neighbour, Neighbour]) -> int:
    """Return the number of a cable: that of the device below it.

    The number of the cable back to the MainDevice is DEVICES.
    """
    one, other = between
    if one == "main" or other == "main":
        return 0 if 0 in between else DEVICES
    return max(one, other)
