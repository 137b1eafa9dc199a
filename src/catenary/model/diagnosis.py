"""Location of faulty cables and devices, based on error counters.

A controller that receives a broken frame counts an invalid frame at that port and marks the frame.
The devices after it only count the frame as forwarded. The fault is therefore between the port with
invalid frames and its neighbour. Symbol errors show noise on that cable, even without broken
frames.
If a cable was unplugged, both ends count lost links. If a device lost its power, only its
neighbours count lost links; its own counters restart at 0.

Sources: Beckhoff, ESC data sheet I, §14 "Error counters" (meaning of each counter; one error may
appear in several); Beckhoff, application note "ESC FAQ", §3.12.4 "Error counter interpretation
guide", figure 2 and table 1, whose cases are cited below; Beckhoff Infosys, EtherCAT system
documentation, "Error counters of the slaves".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from catenary.model.finding import Finding, Kind, Names
from catenary.model.topology import Cable, Topology
from catenary.wire.error_counters import FULL, ErrorCounters, PortErrors

WIDESPREAD = 3  # at least this many noisy cables, and half of all, have a shared cause

_CABLE = "check its plugs, bends, shield and distance to power cables, or replace it"
_DEVICE = "check its supply, its earth connection and the plugs on both sides, or replace it"
_POWER = (
    "check for a weak supply or a loose supply terminal; a cable with one broken pair shows "
    "similar counts"
)
_EVERYWHERE = (
    "check what all devices share: earthing, shields, the supply, and cables next to those of "
    "motors and inverters"
)
_MAIN = (
    "make sure that no other program uses this network interface; then check its driver and its "
    "own error counts (ethtool -S)"
)
_PDI = "the fault is inside the device: update its firmware, or replace it"
_NO_ERRORS = PortErrors()


@dataclass(frozen=True, slots=True)
class Observation:
    """Error counts over a time span, by position. None stands for a device that did not answer."""

    topology: Topology
    names: Names
    errors: tuple[ErrorCounters | None, ...]
    restarted: frozenset[int] = frozenset()  # positions of devices whose counters restarted
    lost_frames: int = 0  # frames that the MainDevice sent but did not get back undamaged

    def port(self, position: int | None, port: int | None) -> PortErrors:
        """Return the counts at one end of a cable; all zero for the MainDevice.

        Args:
            position: Position of the device; None is the MainDevice.
            port: The port of the device.
        """
        if position is None or port is None:
            return _NO_ERRORS
        errors = self.errors[position]
        return _NO_ERRORS if errors is None else errors.ports[port]

    def ends(self, cable: Cable) -> tuple[PortErrors, PortErrors]:
        """Return the counts at both ends of a cable, the upper end first."""
        return self.port(*cable[:2]), self.port(*cable[2:])


def judge(seen: Observation) -> tuple[Finding, ...]:
    """Return the faults, the most probable cause first; empty if there is none."""
    power, explained = _power(seen)
    explained |= _interrupted(seen)
    transport = [*power, *_links(seen, explained), *_noise(seen), *_stray_ports(seen)]
    transport = transport or [*_forwarded(seen), *_processing_units(seen)]
    transport = transport or [*_lost_frames(seen)]
    return (*transport, *_processors(seen))


# ---- lost links


def _power(seen: Observation) -> tuple[list[Finding], set[Cable]]:
    """Return the devices that lost their power, and the cables that this explains.

    All neighbours of such a device have lost the link to it. The device itself has counted no lost
    link, or its counters are known to have restarted. They restart at 0 when the power returns.
    """
    found: list[Finding] = []
    explained: set[Cable] = set()
    for position, errors in enumerate(seen.errors):
        cables = seen.topology.cables_of(position)
        far = [_far_end(cable, position) for cable in cables]
        far = [end for end in far if end[0] is not None]
        lost = [end for end in far if seen.port(*end).lost_links]
        counted = errors is not None and any(port.lost_links for port in errors.ports)
        if errors is None or not lost or len(lost) < len(far):
            continue
        if counted and position not in seen.restarted:
            continue
        explained.update(cables)
        links = " and ".join(
            f"{seen.names.end(*end)} lost its link {_times(seen.port(*end).lost_links)}"
            for end in lost
        )
        where = f"the power of {seen.names.device(position)}"
        evidence = f"{links}, but the device itself has counted none: its counters restarted at 0"
        found.append(Finding(Kind.POWER, where, evidence, _POWER, (position,)))
    return found, explained


def _interrupted(seen: Observation) -> set[Cable]:
    """Return the cables of devices that do not answer; `judge_silence` reports these."""
    silent = {position for position, errors in enumerate(seen.errors) if errors is None}
    return {cable for cable in seen.topology.cables if silent & {cable.upper, cable.lower}}


def _far_end(cable: Cable, position: int) -> tuple[int | None, int | None]:
    return cable[:2] if cable.lower == position else cable[2:]


def _links(seen: Observation, explained: set[Cable]) -> Iterator[Finding]:
    """Yield the cables with lost links: cases 10 and 11 of the guide."""
    for cable in seen.topology.cables:
        ends = seen.ends(cable)
        if cable in explained or not any(end.lost_links for end in ends):
            continue
        yield _cable_finding(seen, cable)


# ---- broken frames


def _noisy(seen: Observation, cable: Cable) -> int:
    return sum(end.invalid_frames + end.symbol_errors for end in seen.ends(cable))


def _noise(seen: Observation) -> Iterator[Finding]:
    """Yield the causes of broken frames: cases 7 to 10, 12 and 16.

    A cable is noisy if it has broken frames or symbol errors, but no lost links. If at least half
    of the cables are noisy (and at least WIDESPREAD), the cause is shared. If exactly the cables of
    one device are noisy (at least two), the cause is the device. Otherwise each noisy cable is a
    cause.
    """
    noisy = [
        cable
        for cable in seen.topology.cables
        if _noisy(seen, cable) and not any(end.lost_links for end in seen.ends(cable))
    ]
    noisy.sort(key=lambda cable: -_noisy(seen, cable))
    if len(noisy) >= WIDESPREAD and 2 * len(noisy) >= len(seen.topology.cables):
        worst = seen.names.cable(noisy[0])
        evidence = (
            f"{len(noisy)} of {len(seen.topology.cables)} cables have broken frames or symbol "
            f"errors; the worst is {worst} with {_noisy(seen, noisy[0])}"
        )
        devices = tuple(sorted(cable.lower for cable in noisy))
        yield Finding(Kind.EVERYWHERE, "the whole segment", evidence, _EVERYWHERE, devices)
        return
    common = _common_device(seen.topology, noisy)
    if common is not None:
        evidence = "all its cables are noisy, and no other cable is: " + "; ".join(
            _counted(seen, cable) for cable in noisy
        )
        where = seen.names.device(common)
        yield Finding(Kind.DEVICE, where, evidence, _DEVICE, (common,))
        return
    yield from (_cable_finding(seen, cable) for cable in noisy)


def _common_device(topology: Topology, noisy: Sequence[Cable]) -> int | None:
    """Return the device whose cables are exactly the noisy ones (at least two), or None."""
    if len(noisy) < 2:
        return None
    for position in range(len(topology)):
        own = set(topology.cables_of(position))
        if own == set(noisy):
            return position
    return None


def _cable_finding(seen: Observation, cable: Cable) -> Finding:
    devices = tuple(end for end in (cable.upper, cable.lower) if end is not None)
    where = seen.names.cable(cable)
    return Finding(Kind.CABLE, where, _counted(seen, cable), _CABLE, devices, cable)


def _counted(seen: Observation, cable: Cable) -> str:
    """Return a text with the counts at both ends of a cable."""
    upper, lower = seen.ends(cable)
    parts = []
    for end, count in ((cable[:2], upper), (cable[2:], lower)):
        if words := _words(count):
            parts.append(f"{words} at {seen.names.end(*end)}")
    return "; ".join(parts)


def _words(count: PortErrors) -> str:
    numbers = (
        (count.invalid_frames, "broken frame"),
        (count.symbol_errors, "symbol error"),
        (count.lost_links, "lost link"),
    )
    return ", ".join(counted(number, what) for number, what in numbers if number)


def _stray_ports(seen: Observation) -> Iterator[Finding]:
    """Yield the ports that count errors although no device is behind them.

    Each is connected to the second end of a ring, or to something that is not an EtherCAT device.
    """
    wired = {end for cable in seen.topology.cables for end in (cable[:2], cable[2:])}
    for position, errors in enumerate(seen.errors):
        for port, count in enumerate(errors.ports if errors is not None else ()):
            noisy = count.invalid_frames or count.symbol_errors or count.lost_links
            if not noisy or (position, port) in wired:
                continue
            second = (position, port) == seen.topology.second_end
            behind = (
                "the MainDevice's second interface" if second else "something that does not answer"
            )
            end = seen.names.end(position, port)
            where = f"the cable between {end} and {behind}"
            evidence = f"{_words(count)} at {end}"
            yield Finding(Kind.CABLE, where, evidence, _CABLE, (position,))


# ---- errors without a located cause


def _forwarded(seen: Observation) -> Iterator[Finding]:
    """Yield the cause of frames that are marked as broken, but that no device counted as invalid.

    The device before the first one that counts forwarded errors has marked them. It may lack the
    counter of invalid frames. The fault is on its input side. Cases 13 to 15.
    """
    path = seen.topology.path()
    first = next((at for at in path if seen.port(*at).forwarded), None)
    if first is None:
        return
    evidence = (
        f"{counted(seen.port(*first).forwarded, 'frame')} arrived at {seen.names.end(*first)} "
        "marked as broken, but no device has counted where they broke"
    )
    rank = path.index(first)
    if rank == 0:
        yield Finding(Kind.MAIN, "the MainDevice's side", evidence, _MAIN)
        return
    cable = seen.topology.cable_at(*path[rank - 1])
    if cable is not None:
        devices = tuple(end for end in (cable.upper, cable.lower) if end is not None)
        where = f"{seen.names.cable(cable)}, or one before it"
        yield Finding(Kind.CABLE, where, evidence, _CABLE, devices, cable)


def _processing_units(seen: Observation) -> Iterator[Finding]:
    """Yield the cause of undamaged frames that are not valid EtherCAT frames: cases 1 and 2.

    At the first device, the MainDevice or another program sends them. At a later device, the
    device before it corrupts them internally.
    """
    for position, errors in enumerate(seen.errors):
        if errors is None or not errors.processing_unit:
            continue
        if errors.ports[0].invalid_frames or errors.ports[0].forwarded:
            continue  # broken frames are counted here as well
        evidence = (
            f"{counted(errors.processing_unit, 'frame')} arrived undamaged at "
            f"{seen.names.device(position)}, but not as valid EtherCAT"
        )
        parent = seen.topology.places[position].parent
        if parent is None:
            yield Finding(Kind.MAIN, "the MainDevice's side", evidence, _MAIN)
        else:
            where = f"{seen.names.device(parent)} or {seen.names.device(position)}"
            yield Finding(Kind.DEVICE, where, evidence, _DEVICE, (parent, position))
        return


def _lost_frames(seen: Observation) -> Iterator[Finding]:
    """Yield the cause of lost or broken frames that no device has counted: cases 5 and 6.

    They were lost after the last port with a counter, on the way back to the MainDevice.
    """
    if not seen.lost_frames or None in seen.errors:
        return
    evidence = (
        f"{counted(seen.lost_frames, 'frame')} did not return undamaged, but no device has counted "
        "a broken one"
    )
    where = f"the path from {seen.names.device(0)} back to the MainDevice, its port or its driver"
    advice = f"the cable to the first device: {_CABLE}; {_MAIN}"
    yield Finding(Kind.MAIN, where, evidence, advice, (0,), seen.topology.cables[0])


# ---- inside a device


def _processors(seen: Observation) -> Iterator[Finding]:
    for position, errors in enumerate(seen.errors):
        if errors is not None and errors.pdi:
            evidence = f"{counted(errors.pdi, 'error')} at the interface to its processor (PDI)"
            where = seen.names.device(position)
            yield Finding(Kind.DEVICE, where, evidence, _PDI, (position,))


def counted(count: int, what: str) -> str:
    """Return a count with its noun: "1 frame", "255 or more frames" (a counter stops at 255).

    Args:
        count: The value of the counter.
        what: The noun, in the singular.
    """
    if count == 1:
        return f"1 {what}"
    return f"{count} {what}s" if count < FULL else f"{FULL} or more {what}s"


def _times(count: int) -> str:
    return "once" if count == 1 else counted(count, "time")
